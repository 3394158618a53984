//! Estimate of an observer by posterior means.

use super::posterior_density::{LapsePrior, Nodes, PosteriorDensity};
use super::psychometric::NotBounded;
use super::{Estimate, Observation, Prior};

/// Node counts for the means.
const NODES: Nodes = Nodes { thresholds: 24, criteria: 16, lapses: 1 };

/// Estimates the observer by posterior means (geometric means for sigma and threshold); also returns the sides on which the
/// answers do not bound the threshold, `None` if the answers bound both sides.
pub(crate) fn posterior_mean(
    observations: &[Observation],
    prior: &Prior,
    target: f64,
) -> (Estimate, Option<NotBounded>) {
    let lapse = LapsePrior::Known(prior.lapse);
    let posterior = PosteriorDensity::new(observations, prior, target, lapse, NODES);
    let estimate = Estimate {
        sigma: libm::exp(posterior.mean_log_sigma),
        criterion: posterior.mean_criterion,
        threshold: libm::exp(posterior.mean_log_threshold),
    };
    (estimate, NotBounded::of(posterior.is_bounded))
}
