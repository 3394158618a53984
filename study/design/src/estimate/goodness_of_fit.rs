//! Goodness of fit of an observer, by simulation (Wichmann and Hill, Perception & Psychophysics 63:1293, 2001): a track has too
//! few answers at each difference for the chi-square distribution.

use super::{Observation, probability};
use crate::answer::Judgement;
use crate::observer::TernaryObserver;
use crate::random::{Purpose, Stream};
use serde::Serialize;

/// Number of simulated answer sets.
const SETS: u32 = 999;
/// Maximum number of classes; below, minimum mean number of answers per class if there are several classes.
const CLASSES_MOST: usize = 4;
const ANSWERS_LEAST: usize = 6;

/// Pearson's chi-square test of the three kinds of answers, in classes of similar differences, against the fitted observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GoodnessOfFit {
    /// Pearson's statistic: sum over classes and kinds of answer of `(observed - expected)² / expected`.
    pub chi_square: f64,
    /// Number of classes into which the differences are divided.
    pub classes: usize,
    /// p-value: fraction of answer sets with an equal or larger statistic, among sets simulated from the fitted observer at the
    /// same differences and the observed set.
    pub p: f64,
}

/// Tests the fit of an observer to answers. The simulation has a fixed seed, so equal answers give equal p-values.
pub(super) fn of(observations: &[Observation], observer: &TernaryObserver) -> GoodnessOfFit {
    let mut sorted = observations.to_vec();
    sorted.sort_by(|a, b| a.delta.total_cmp(&b.delta));
    let shares_of = |one: &Observation| {
        Judgement::ALL.map(|judgement| probability(observer, &Observation { judgement, ..*one }))
    };
    let shares: Vec<[f64; 3]> = sorted.iter().map(shares_of).collect();
    let sum = |class: &[Observation]| {
        class
            .iter()
            .map(shares_of)
            .fold([0.0; 3], |sum, shares| [0, 1, 2].map(|kind: usize| sum[kind] + shares[kind]))
    };
    let expected: Vec<(usize, [f64; 3])> =
        classes(&sorted).into_iter().map(|class| (class.len(), sum(class))).collect();
    let chi_square = |kinds: &mut dyn Iterator<Item = usize>| {
        let mut sum = 0.0;
        for (answers, expected) in &expected {
            let mut counts = [0.0; 3];
            for kind in kinds.take(*answers) {
                if let Some(count) = counts.get_mut(kind) {
                    *count += 1.0;
                }
            }
            sum += counts.iter().zip(expected).map(|(n, e): (&f64, &f64)| (n - e) * (n - e) / e).sum::<f64>();
        }
        sum
    };
    let kind =
        |one: &Observation| Judgement::ALL.iter().position(|known| *known == one.judgement).unwrap_or(0);
    let found = chi_square(&mut sorted.iter().map(kind));
    let mut stream = Stream::new(0, Purpose::GoodnessOfFit, 0, 0);
    let mut drawn = || {
        let mut kinds = shares.iter().map(|[correct, wrong, _]| match stream.uniform() {
            draw if draw < *correct => 0,
            draw if draw < correct + wrong => 1,
            _ => 2,
        });
        chi_square(&mut kinds)
    };
    let larger = (0..SETS).filter(|_| drawn() >= found).count();
    GoodnessOfFit {
        chi_square: found,
        classes: expected.len(),
        p: (larger as f64 + 1.0) / f64::from(SETS + 1),
    }
}

/// Splits answers, sorted by difference, into classes of about equal size; answers to equal differences are in the same class.
fn classes(sorted: &[Observation]) -> Vec<&[Observation]> {
    let most = (sorted.len() / ANSWERS_LEAST).clamp(1, CLASSES_MOST);
    let mut found = Vec::new();
    let mut rest = sorted;
    while !rest.is_empty() {
        let size = rest.len().div_ceil(most - found.len().min(most - 1));
        let last = rest.get(size - 1).map_or(0.0, |one| one.delta);
        let end = rest.partition_point(|one| one.delta <= last);
        let (class, after) = rest.split_at(end);
        found.push(class);
        rest = after;
    }
    found
}
