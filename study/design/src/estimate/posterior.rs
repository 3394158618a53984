//! Posterior over a grid of observers, and selection of the most informative next difference.
//!
//! Implements QUEST+ (Watson, Journal of Vision 17(3):10, 2017) with three answers. The information of a trial is the mutual
//! information of answer and observer: the entropy of the predicted answer minus the expected entropy of the answer of a known
//! observer.

use super::{Observation, Prior, probability};
use crate::answer::Judgement;
use crate::observer::TernaryObserver;

/// Number of thresholds in the grid of observers, evenly spaced in their logarithm; below, number of criteria, evenly spaced
/// from 0.
const THRESHOLDS: u32 = 31;
const CRITERIA: u32 = 10;
/// Extent of the grid from the prior's centre, in standard deviations of the prior.
const REACH: f64 = 3.0;
/// Number of candidate differences, evenly spaced in their logarithm.
const DELTAS: u32 = 40;

/// Grid of observers and candidate differences; constant during a track.
#[derive(Clone, Debug)]
pub struct PosteriorGrid {
    observers: Vec<Member>,
    deltas: Vec<f64>,
}

/// One observer of a grid.
#[derive(Clone, Debug)]
struct Member {
    observer: TernaryObserver,
    prior: f64,
    /// Probabilities of the three answers and their entropy, at each candidate difference.
    answers: Vec<([f64; 3], f64)>,
}

impl PosteriorGrid {
    /// Builds the grid from a prior, the target performance (`P(correct) + P(don't know) / 2` at the threshold), and the smallest
    /// and largest candidate difference, as fractions of the base.
    #[must_use]
    pub fn new(prior: &Prior, target: f64, least_delta: f64, most_delta: f64) -> Self {
        let share = |index: u32, of: u32| f64::from(index) / f64::from(of.saturating_sub(1).max(1));
        let ratio = libm::log(most_delta / least_delta);
        let deltas: Vec<f64> =
            (0..DELTAS).map(|index| least_delta * libm::exp(ratio * share(index, DELTAS))).collect();
        let mut observers = Vec::new();
        for threshold in 0..THRESHOLDS {
            let z = REACH * (2.0 * share(threshold, THRESHOLDS) - 1.0);
            let threshold = prior.threshold_median * libm::exp(prior.threshold_spread * z);
            for criterion in 0..CRITERIA {
                let criterion =
                    share(criterion, CRITERIA) * (prior.criterion_mode + REACH * prior.criterion_spread);
                let observer = prior.observer(threshold, criterion, target);
                let answers = deltas.iter().map(|delta| answers(&observer, *delta)).collect();
                let weight = libm::exp(prior.log_density(libm::log(threshold), criterion));
                observers.push(Member { observer, prior: weight, answers });
            }
        }
        Self { observers, deltas }
    }
}

fn answers(observer: &TernaryObserver, delta: f64) -> ([f64; 3], f64) {
    let shares = Judgement::ALL.map(|judgement| probability(observer, &Observation { delta, judgement }));
    (shares, entropy(&shares))
}

fn entropy(shares: &[f64]) -> f64 {
    shares.iter().filter(|share| **share > 0.0).map(|share| -share * libm::log(*share)).sum()
}

/// Posterior probability of each observer of a grid.
#[derive(Clone, Debug)]
pub struct Posterior {
    weights: Vec<f64>,
}

impl Posterior {
    /// Creates the posterior before the first answer, the normalised prior.
    #[must_use]
    pub fn new(grid: &PosteriorGrid) -> Self {
        let mut posterior = Self { weights: grid.observers.iter().map(|member| member.prior).collect() };
        posterior.normalise();
        posterior
    }

    /// Updates the posterior with an answer to any difference (Bayes' rule).
    pub fn answer(&mut self, grid: &PosteriorGrid, observation: &Observation) {
        for (weight, member) in self.weights.iter_mut().zip(&grid.observers) {
            *weight *= probability(&member.observer, observation);
        }
        self.normalise();
    }

    fn normalise(&mut self) {
        let sum: f64 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight /= sum);
    }

    /// Returns the candidate difference whose answer is expected to be the most informative.
    #[must_use]
    pub fn best_delta(&self, grid: &PosteriorGrid) -> f64 {
        let mut best = (f64::NEG_INFINITY, 0.0);
        for (index, delta) in grid.deltas.iter().copied().enumerate() {
            let mut expected = [0.0; 3];
            let mut known = 0.0;
            for (weight, member) in self.weights.iter().zip(&grid.observers) {
                if let Some((shares, entropy)) = member.answers.get(index) {
                    expected.iter_mut().zip(shares).for_each(|(sum, share)| *sum += weight * share);
                    known += weight * entropy;
                }
            }
            let told = entropy(&expected) - known;
            if told > best.0 {
                best = (told, delta);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers of one kind only move the posterior the way they must, and the next difference with it.
    #[test]
    fn posterior_follows_the_answers() {
        let grid = PosteriorGrid::new(&Prior::default(), 0.75, 0.01, 0.95);
        let start = Posterior::new(&grid);
        let after = |judgement| {
            let mut posterior = start.clone();
            for _ in 0..6 {
                let delta = posterior.best_delta(&grid);
                posterior.answer(&grid, &Observation { delta, judgement });
            }
            posterior.best_delta(&grid)
        };
        let middle = start.best_delta(&grid);
        let (keen, dull) = (after(Judgement::Correct), after(Judgement::Wrong));
        assert!(keen < middle && middle < dull, "{keen:?} {middle:?} {dull:?}");
        assert!((start.weights.iter().sum::<f64>() - 1.0).abs() < 1.0e-12);
    }
}
