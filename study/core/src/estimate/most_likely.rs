//! The observer most likely in the light of prior and answers (maximum a posteriori).
//!
//! Where a density is highest depends on the scale it is over. Here it is the density over the slope, which is as 1 / threshold, in
//! which the likelihood of answers is closest to symmetric; over the threshold or its logarithm the estimate of a single track
//! would be several percent low.

use super::{Estimate, Observation, Prior, probability};

/// Steps of the first, coarse look, each way from the median of the prior, and their size in deviations of it.
const COARSE_STEPS: i32 = 6;
const COARSE_SIZE: f64 = 0.5;
/// Halvings of the search that follows: 0.25 deviations down to 1e-5 of them.
const HALVINGS: u32 = 15;

/// Finds the most likely observer, and the difference at which that observer reaches the target.
///
/// Which procedure placed the trials does not matter: given the differences, the answers have the same likelihood.
#[must_use]
pub fn most_likely(observations: &[Observation], prior: &Prior, target: f64) -> Estimate {
    let (centre, spread) = (
        [libm::log(prior.threshold_median), prior.criterion_mode],
        [prior.threshold_spread, prior.criterion_spread],
    );
    let score = |[threshold, criterion]: [f64; 2]| {
        let log_density = prior.log_density(threshold, criterion);
        if log_density == f64::NEG_INFINITY {
            return log_density;
        }
        let observer = prior.observer(libm::exp(threshold), criterion, target);
        let likelihood: f64 =
            observations.iter().map(|observation| libm::log(probability(&observer, observation))).sum();
        // A density over the logarithm, times the threshold: over the slope.
        likelihood + log_density + threshold
    };
    let step =
        |from: [f64; 2], steps: [f64; 2]| [from[0] + steps[0] * spread[0], from[1] + steps[1] * spread[1]];
    let mut best = centre;
    let mut best_score = score(best);
    let mut consider = |place: [f64; 2], best: &mut [f64; 2]| {
        let score = score(place);
        if score > best_score {
            (best_score, *best) = (score, place);
            return true;
        }
        false
    };
    for threshold in -COARSE_STEPS..=COARSE_STEPS {
        for criterion in -COARSE_STEPS..=COARSE_STEPS {
            let steps = [f64::from(threshold) * COARSE_SIZE, f64::from(criterion) * COARSE_SIZE];
            consider(step(centre, steps), &mut best);
        }
    }
    // Compass search: the posterior is smooth with one peak nearby.
    let mut size = 0.5 * COARSE_SIZE;
    for _ in 0..HALVINGS {
        loop {
            let around = [[size, 0.0], [-size, 0.0], [0.0, size], [0.0, -size], [size, size], [-size, -size]];
            let diagonal = [[size, -size], [-size, size]];
            let from = best;
            let better = around.iter().chain(&diagonal).any(|steps| consider(step(from, *steps), &mut best));
            if !better {
                break;
            }
        }
        size *= 0.5;
    }
    let [log_threshold, criterion] = best;
    let threshold = libm::exp(log_threshold);
    // The threshold is that of attention: lapses are not a matter of sensitivity.
    Estimate { sigma: prior.observer(threshold, criterion, target).sigma, criterion, threshold }
}
