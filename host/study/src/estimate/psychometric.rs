//! The psychometric function of one subject in one condition: threshold and lapse, each with an interval.
//!
//! The posterior over threshold, criterion and lapse on a grid, from the [`Prior`] of the other estimators and, for the lapse,
//! an exponential prior with a mean of 2 % (Kuss, Jäkel and Wichmann 2005 use one of that size). The interval holds 95 % of it.

use super::{Observation, Prior, probability};
use serde::Serialize;

const THRESHOLDS: u32 = 61;
const CRITERIA: u32 = 11;
const LAPSES: [f64; 7] = [0.0, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16];
/// The grid reaches so many deviations of the prior to both sides.
const REACH: f64 = 3.0;
const MEAN_LAPSE: f64 = 0.02;

/// What a subject's answers in one condition say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Psychometric {
    /// Answers it is made from.
    pub answers: usize,
    /// Median of the threshold, as a share of the base.
    pub threshold: f64,
    /// 95 % of it.
    pub threshold_interval: [f64; 2],
    /// Mean share of trials without attention.
    pub lapse: f64,
    /// The smallest lapse that 97.5 % lie below.
    pub lapse_most: f64,
}

/// The psychometric function that these answers are most likely to come from; `target` is the share of correct answers at the
/// threshold. None without answers.
#[must_use]
pub fn psychometric(observations: &[Observation], prior: &Prior, target: f64) -> Option<Psychometric> {
    if observations.is_empty() {
        return None;
    }
    let mut cells: Vec<(f64, f64, f64)> = Vec::new(); // threshold, lapse, logarithm of the density
    for threshold in 0..THRESHOLDS {
        let z = REACH * (2.0 * f64::from(threshold) / f64::from(THRESHOLDS - 1) - 1.0);
        let log_threshold = libm::log(prior.threshold_median) + prior.threshold_spread * z;
        let threshold = libm::exp(log_threshold);
        for criterion in 0..CRITERIA {
            let most = prior.criterion_mode + REACH * prior.criterion_spread;
            let criterion = most * f64::from(criterion) / f64::from(CRITERIA - 1);
            let before = prior.log_density(log_threshold, criterion);
            for (index, lapse) in LAPSES.into_iter().enumerate() {
                let with = Prior { lapse: lapse.max(0.001), ..*prior };
                let observer = with.observer(threshold, criterion, target);
                let likely: f64 = observations.iter().map(|one| libm::log(probability(&observer, one))).sum();
                // The cells of the lapse are of unequal width.
                let width = LAPSES.get(index + 1).map_or(0.06, |next| next - lapse);
                cells.push((threshold, lapse, before + likely - lapse / MEAN_LAPSE + libm::log(width)));
            }
        }
    }
    let most = cells.iter().map(|(.., log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let weigh = |value: fn(&(f64, f64, f64)) -> f64| {
        let mut list: Vec<(f64, f64)> =
            cells.iter().map(|cell| (value(cell), libm::exp(cell.2 - most))).collect();
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        list
    };
    let (thresholds, lapses) = (weigh(|cell| cell.0), weigh(|cell| cell.1));
    let total: f64 = lapses.iter().map(|(_, weight)| weight).sum();
    Some(Psychometric {
        answers: observations.len(),
        threshold: quantile(&thresholds, 0.5),
        threshold_interval: [0.025, 0.975].map(|share| quantile(&thresholds, share)),
        lapse: lapses.iter().map(|(lapse, weight)| lapse * weight).sum::<f64>() / total,
        lapse_most: quantile(&lapses, 0.975),
    })
}

/// The value below which a share of the weights lies.
fn quantile(sorted: &[(f64, f64)], share: f64) -> f64 {
    let total: f64 = sorted.iter().map(|(_, weight)| weight).sum();
    let mut below = 0.0;
    for (value, weight) in sorted {
        below += weight;
        if below >= share * total {
            return *value;
        }
    }
    sorted.last().map_or(f64::NAN, |(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::TernaryObserver;
    use crate::trial::Judgement;

    /// Answers in the shares that an observer is expected to give, at differences about the threshold.
    fn answers(observer: &TernaryObserver, each: u32) -> Vec<Observation> {
        let threshold = observer.threshold(0.75);
        let mut list = Vec::new();
        for factor in [0.3, 0.6, 1.0, 1.5, 2.5, 4.0] {
            let delta = factor * threshold;
            let [correct, wrong] = observer.correct_and_wrong(delta);
            for index in 0..each {
                let share = (f64::from(index) + 0.5) / f64::from(each);
                let judgement = match share {
                    share if share < correct => Judgement::Correct,
                    share if share < correct + wrong => Judgement::Wrong,
                    _ => Judgement::Unsure,
                };
                list.push(Observation { delta, judgement });
            }
        }
        list
    }

    #[test]
    fn threshold_and_lapse_of_a_known_observer_are_found_and_more_answers_say_more() {
        let attentive = TernaryObserver { sigma: 0.12, criterion: 0.8, bias: 0.0, lapse: 0.0 };
        let known = attentive.threshold(0.75);
        let of = |observer, each| psychometric(&answers(observer, each), &Prior::default(), 0.75).unwrap();
        let (few, many) = (of(&attentive, 8), of(&attentive, 60));
        let width = |found: Psychometric| found.threshold_interval[1] - found.threshold_interval[0];
        assert!(width(many) < 0.6 * width(few), "{few:?} {many:?}");
        // The grid has steps of 7 %.
        assert!((many.threshold / known - 1.0).abs() < 0.1, "{many:?} for {known}");
        assert!(many.lapse < 0.02, "{many:?}");
        let absent = TernaryObserver { lapse: 0.12, ..attentive };
        let found = of(&absent, 60);
        assert!(found.lapse > 0.05 && found.lapse_most >= 0.11, "{found:?}");
        assert_eq!(psychometric(&[], &Prior::default(), 0.75), None);
    }
}
