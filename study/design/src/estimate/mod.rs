//! Threshold estimators that use all answers; more precise than the mean of a few reversals.
//!
//! An observer has two parameters (`sigma`, `criterion`; see [`TernaryObserver`]), estimated from the likelihood of the answers
//! and a weakly informative prior. [`most_likely`] finds the most likely pair of parameters for any set of trials;
//! [`Posterior`] holds the probabilities of a grid of pairs, from which the next trial can be chosen as well.

mod goodness_of_fit;
mod most_likely;
mod posterior;
mod posterior_density;
mod posterior_mean;
mod psychometric;

pub use goodness_of_fit::GoodnessOfFit;
pub use most_likely::most_likely;
pub use posterior::{Posterior, PosteriorGrid};
pub(crate) use posterior_mean::posterior_mean;
pub use psychometric::{NotBounded, Psychometric, psychometric};

use crate::answer::Judgement;
use crate::observer::TernaryObserver;
use flotor_statistics::distribution::{normal_below, normal_density};
use serde::{Deserialize, Serialize};

/// Judged answer to a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Magnitude of the difference of comparison and base, as a fraction of the base.
    pub delta: f64,
    /// Judgement of the answer.
    pub judgement: Judgement,
}

/// Prior before the first answer. By default the threshold is lognormal about the geometric mean of the thresholds published
/// for stiffness (8 to 25 %, geometric mean 14 %), so wide that all of them lie within one standard deviation; the criterion is
/// a normal distribution truncated at 0, from people who always name a stimulus to people who say "I don't know" in half of the
/// trials. The prior is on the threshold, not on sigma, because the threshold is the quantity of interest: an observer without
/// "I don't know" has another sigma at the same threshold, and a prior on sigma would separate the two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Prior {
    /// Median of the threshold, as a fraction of the base.
    pub threshold_median: f64,
    /// Standard deviation of the natural logarithm of the threshold.
    pub threshold_spread: f64,
    /// Mode of the criterion, in standard deviations of the noise.
    pub criterion_mode: f64,
    /// Standard deviation of the criterion before truncation, in standard deviations of the noise.
    pub criterion_spread: f64,
    /// Fixed lapse rate (fraction of trials answered by chance): prevents one slip from outweighing all other answers.
    pub lapse: f64,
}

impl Default for Prior {
    fn default() -> Self {
        Self {
            threshold_median: 0.14,
            threshold_spread: 0.7,
            criterion_mode: 0.75,
            criterion_spread: 0.5,
            lapse: 0.005,
        }
    }
}

impl Prior {
    /// Returns the observer with a given criterion who, lapses aside, reaches the target at `threshold`.
    fn observer(&self, threshold: f64, criterion: f64, target: f64) -> TernaryObserver {
        let sigma = threshold / unit_threshold(criterion, target);
        TernaryObserver { sigma, criterion, bias: 0.0, lapse: self.lapse }
    }

    /// Returns the logarithm of the prior density over log threshold and criterion, up to a constant; negative infinity for a
    /// negative criterion.
    fn log_density(&self, log_threshold: f64, criterion: f64) -> f64 {
        if criterion < 0.0 {
            return f64::NEG_INFINITY;
        }
        let threshold = (log_threshold - libm::log(self.threshold_median)) / self.threshold_spread;
        let criterion = (criterion - self.criterion_mode) / self.criterion_spread;
        -0.5 * (threshold * threshold + criterion * criterion)
    }
}

/// Returns the threshold of an observer with sigma 1 and no lapses: the solution of `P(correct) + P(don't know) / 2 = target`.
///
/// Newton's method; a test compares it with bisection.
fn unit_threshold(criterion: f64, target: f64) -> f64 {
    let mut delta = criterion.max(0.1);
    for _ in 0..40 {
        let reached = 0.5 * (1.0 + normal_below(delta - criterion) - normal_below(-delta - criterion));
        let step = (target - reached)
            / (0.5 * (normal_density(delta - criterion) + normal_density(delta + criterion)));
        delta = (delta + step).max(1.0e-6);
        if step.abs() < 1.0e-12 {
            break;
        }
    }
    delta
}

/// Estimated parameters of an observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Standard deviation of the noise, as a fraction of the base.
    pub sigma: f64,
    /// Criterion for "I don't know", in standard deviations of the noise.
    pub criterion: f64,
    /// Threshold: difference at which `P(correct) + P(don't know) / 2`, lapses aside, equals the target, as a fraction of the base.
    pub threshold: f64,
}

/// Returns the probability that an observer gives this answer.
fn probability(observer: &TernaryObserver, observation: &Observation) -> f64 {
    let [correct, wrong] = observer.correct_and_wrong(observation.delta);
    match observation.judgement {
        Judgement::Correct => correct,
        Judgement::Wrong => wrong,
        // Rounding may give a slightly negative probability.
        Judgement::Unsure => (1.0 - correct - wrong).max(f64::MIN_POSITIVE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quick way to a threshold and the plain one agree, for every criterion and target there may be.
    #[test]
    fn thresholds_agree_with_bisection() {
        for criterion in [0.0, 0.1, 0.5, 1.0, 1.7, 2.25] {
            for target in [0.6, 0.75, 0.9] {
                let plain =
                    TernaryObserver { sigma: 1.0, criterion, bias: 0.0, lapse: 0.0 }.threshold(target);
                let quick = unit_threshold(criterion, target);
                assert!((quick - plain).abs() < 1.0e-9, "{criterion} {target}: {quick} for {plain}");
            }
        }
    }
}
