//! Thresholds from answers: better than the mean of a few reversals.
//!
//! An observer is described by two numbers (`sigma`, `criterion`; see [`TernaryObserver`]), held against the answers by
//! their likelihood and a weak prior. [`most_likely`] finds the best pair for any trials, however they were placed;
//! [`Belief`] holds the probability of many pairs, from which the next trial can be chosen as well.

mod belief;
mod most_likely;

pub use belief::{Belief, BeliefGrid};
pub use most_likely::most_likely;

use crate::observer::TernaryObserver;
use crate::trial::Judgement;
use serde::{Deserialize, Serialize};

/// One answer: the difference it was given at, as a share of the base, and what it was worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Difference.
    pub delta: f64,
    /// Worth.
    pub judgement: Judgement,
}

/// What is held likely before the first answer: sigma lognormal, wide enough for any stiffness threshold in the
/// literature (8 to 25 %) to lie within one deviation; the criterion normal where it is not negative, from people who
/// always answer to those who say "I don't know" in half of the trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Median of sigma, as a share of the base.
    pub sigma_median: f64,
    /// Deviation of its logarithm.
    pub sigma_spread: f64,
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
            sigma_median: 0.12,
            sigma_spread: 0.7,
            criterion_mode: 0.75,
            criterion_spread: 0.5,
            lapse: 0.005,
        }
    }
}

impl Prior {
    fn observer(&self, sigma: f64, criterion: f64) -> TernaryObserver {
        TernaryObserver { sigma, criterion, bias: 0.0, lapse: self.lapse }
    }

    /// Logarithm of the density over the logarithm of sigma and the criterion, up to a constant.
    fn log_density(&self, log_sigma: f64, criterion: f64) -> f64 {
        if criterion < 0.0 {
            return f64::NEG_INFINITY;
        }
        let sigma = (log_sigma - libm::log(self.sigma_median)) / self.sigma_spread;
        let criterion = (criterion - self.criterion_mode) / self.criterion_spread;
        -0.5 * (sigma * sigma + criterion * criterion)
    }
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
