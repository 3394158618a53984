//! Thresholds from answers: better than the mean of a few reversals.
//!
//! An observer is described by two numbers (`sigma`, `criterion`; see [`TernaryObserver`]), held against the answers by
//! their likelihood and a weak prior. [`most_likely`] finds the best pair for any trials, however they were placed;
//! [`Posterior`] holds the probability of many pairs, from which the next trial can be chosen as well.

mod goodness_of_fit;
mod most_likely;
mod posterior;
mod posterior_density;
mod psychometric;

pub use most_likely::most_likely;
pub use posterior::{Posterior, PosteriorGrid};
pub use psychometric::{GoodnessOfFit, NotBounded, Psychometric, psychometric};

use crate::observer::TernaryObserver;
use crate::trial::Judgement;
use flotor_statistics::distribution::normal_below;
use posterior_density::{LapsePrior, Nodes, PosteriorDensity};
use serde::{Deserialize, Serialize};

/// One answer: the difference it was given at, as a share of the base, and what it was worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Difference.
    pub delta: f64,
    /// Worth.
    pub judgement: Judgement,
}

/// What is held likely before the first answer: the threshold lognormal about the middle of those published for
/// stiffness (8 to 25 %, whose geometric mean is 14 %), so wide that all of them lie within one deviation; the criterion
/// normal where it is not negative, from people who always answer to those who say "I don't know" in half of the
/// trials. The threshold and not sigma, because it is what is asked for: who never says "I don't know" has another sigma
/// at the same threshold, and a prior on sigma would draw the two apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Median of the threshold, as a share of the base.
    pub threshold_median: f64,
    /// Deviation of its logarithm.
    pub threshold_spread: f64,
    /// Most likely criterion.
    pub criterion_mode: f64,
    /// Its deviation.
    pub criterion_spread: f64,
    /// Share of trials answered by chance, held fixed: it keeps one slip from outweighing all other answers.
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
    /// The observer of this criterion who reaches the target at this difference, while attentive.
    fn observer(&self, threshold: f64, criterion: f64, target: f64) -> TernaryObserver {
        let sigma = threshold / unit_threshold(criterion, target);
        TernaryObserver { sigma, criterion, bias: 0.0, lapse: self.lapse }
    }

    /// Logarithm of the density over the logarithm of the threshold and the criterion, up to a constant.
    fn log_density(&self, log_threshold: f64, criterion: f64) -> f64 {
        if criterion < 0.0 {
            return f64::NEG_INFINITY;
        }
        let threshold = (log_threshold - libm::log(self.threshold_median)) / self.threshold_spread;
        let criterion = (criterion - self.criterion_mode) / self.criterion_spread;
        -0.5 * (threshold * threshold + criterion * criterion)
    }
}

/// The threshold of an attentive observer of sigma 1: where `P(correct) + P(don't know) / 2` is the target.
///
/// Newton's method; a test holds it against bisection.
fn unit_threshold(criterion: f64, target: f64) -> f64 {
    let density = |x: f64| libm::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
    let mut delta = criterion.max(0.1);
    for _ in 0..40 {
        let reached = 0.5 * (1.0 + normal_below(delta - criterion) - normal_below(-delta - criterion));
        let step = (target - reached) / (0.5 * (density(delta - criterion) + density(delta + criterion)));
        delta = (delta + step).max(1.0e-6);
        if step.abs() < 1.0e-12 {
            break;
        }
    }
    delta
}

/// What answers say about an observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Sigma.
    pub sigma: f64,
    /// Criterion.
    pub criterion: f64,
    /// The difference at which the target is reached.
    pub threshold: f64,
}

/// Estimates the observer by the means of the posterior, sigma and threshold by geometric ones, and says which ends of the threshold
/// the answers do not bound.
pub(crate) fn posterior_mean(
    observations: &[Observation],
    prior: &Prior,
    target: f64,
) -> (Estimate, Option<NotBounded>) {
    const NODES: Nodes = Nodes { thresholds: 24, criteria: 16, lapses: 1 };
    let lapse = LapsePrior::Known(prior.lapse);
    let posterior = PosteriorDensity::new(observations, prior, target, lapse, NODES);
    let estimate = Estimate {
        sigma: libm::exp(posterior.mean_log_sigma),
        criterion: posterior.mean_criterion,
        threshold: libm::exp(posterior.mean_log_threshold),
    };
    (estimate, NotBounded::of(posterior.is_bounded))
}

/// Probability that an observer answers so.
fn probability(observer: &TernaryObserver, observation: &Observation) -> f64 {
    let [correct, wrong] = observer.correct_and_wrong(observation.delta);
    match observation.judgement {
        Judgement::Correct => correct,
        Judgement::Wrong => wrong,
        // Rounding may leave a little less than nothing.
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
