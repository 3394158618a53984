//! Most likely observer given prior and answers (maximum a posteriori estimate, MAP).
//!
//! The mode of a density depends on the parametrisation. Here the parameter is the slope, proportional to 1 / threshold, for
//! which the likelihood is closest to symmetric; with the threshold or its logarithm as the parameter, the estimate from a
//! single track would be several percent too low.

use super::{Estimate, Observation, Prior, probability};

/// Number of steps of the coarse grid search in each direction from the prior's centre; below, their size in standard
/// deviations of the prior.
const COARSE_STEPS: i32 = 6;
const COARSE_SIZE: f64 = 0.5;
/// Number of halvings of the step in the compass search: from 0.25 to 1e-5 standard deviations of the prior.
const HALVINGS: u32 = 15;

/// Finds the most likely observer, and the threshold: the difference at which the observer, lapses aside, reaches the target.
///
/// The estimate does not depend on the procedure that placed the trials: given the differences, the likelihood is the same.
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
        // Adding the log threshold converts the density over the log threshold to the density over the slope (Jacobian).
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
    // Compass search: the posterior is smooth and has one maximum nearby.
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
    // Threshold of an attentive observer: lapses do not measure sensitivity.
    Estimate { sigma: prior.observer(threshold, criterion, target).sigma, criterion, threshold }
}
