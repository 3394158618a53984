//! Bias and standard deviation of each threshold estimator, from many simulated tracks of observers with known thresholds.

use crate::observer::TernaryObserver;
use crate::trial::{Judgement, Position};
use flotor_statistics::describe::{deviation, mean};
use flotor_study_design::estimate::{Observation, Prior, most_likely};
use flotor_study_design::procedure::{Procedure, QuestPlusRule, Track, WeightedUpDownRule};
use flotor_study_design::random::{Purpose, Stream};
use flotor_study_design::words;
use serde::Serialize;

/// Procedure and estimator of a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Weighted up-down; mean of the differences from the 4th to the 8th reversal.
    Thesis,
    /// Weighted up-down; threshold of the most likely observer ([`most_likely`]).
    Map,
    /// QUEST+; posterior mean.
    QuestPlus,
}

impl Method {
    /// All methods in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Thesis, Self::Map, Self::QuestPlus];
}

words! { Method { Thesis = "thesis", Map = "map", QuestPlus = "questplus" } }

/// Accuracy of one method for one observer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BiasRow {
    /// Criterion of the observer, in standard deviations of the noise.
    pub criterion: f64,
    /// True threshold, as a fraction of the base (Weber fraction).
    pub threshold: f64,
    /// Number of tracks per estimate.
    pub tracks: u32,
    /// Procedure and estimator.
    pub method: Method,
    /// Number of finite estimates.
    pub runs: u32,
    /// Relative bias: mean estimate divided by the true threshold, minus 1.
    pub bias: f64,
    /// Standard deviation of the estimates, as a fraction of the true threshold.
    pub deviation: f64,
    /// Root mean square error of the estimates, as a fraction of the true threshold.
    pub rms_error: f64,
    /// Mean number of trials per track.
    pub trials: f64,
}

/// Simulates every method with an observer, at a target of 75 %: `runs` estimates, each from `tracks` tracks (mean of the
/// tracks' thresholds for `thesis` and `questplus`, all trials together for `map`).
#[must_use]
pub fn rows(observer: &TernaryObserver, tracks: u32, runs: u32, seed: u64) -> Vec<BiasRow> {
    let threshold = observer.threshold(0.75);
    // Without a floor, as in published simulations of the rule.
    let up_down = WeightedUpDownRule { floor: 0.0, ..WeightedUpDownRule::default() };
    let up_down = Procedure::WeightedUpDown(up_down).start();
    let quest = Procedure::QuestPlus(QuestPlusRule::default()).start();
    let prior = Prior::default();
    let mut estimates: [Vec<f64>; 3] = Default::default();
    let mut trials = [0.0; 2];
    for run in 0..runs {
        let (mut answers, mut thresholds) = (Vec::new(), Vec::new());
        let mut placed = Vec::new();
        for track in 0..tracks {
            let mut stream = Stream::new(seed, Purpose::Answer, 1, run * tracks + track);
            let (found, given) = walk(up_down.clone(), observer, &mut stream);
            trials[0] += f64::from(u32::try_from(given.len()).unwrap_or(u32::MAX));
            answers.extend(given);
            thresholds.extend(found);
            let (found, given) = walk(quest.clone(), observer, &mut stream);
            trials[1] += f64::from(u32::try_from(given.len()).unwrap_or(u32::MAX));
            placed.extend(found);
        }
        let map = most_likely(&answers, &prior, 0.75).threshold;
        for (list, estimate) in estimates.iter_mut().zip([mean(&thresholds), map, mean(&placed)]) {
            if estimate.is_finite() {
                list.push(estimate);
            }
        }
    }
    let per_track = |sum: f64| sum / f64::from(runs * tracks);
    let row = |(method, estimates): (Method, &Vec<f64>)| {
        let relative: Vec<f64> = estimates.iter().map(|estimate| estimate / threshold - 1.0).collect();
        let squares: Vec<f64> = relative.iter().map(|error| error * error).collect();
        BiasRow {
            criterion: observer.criterion,
            threshold,
            tracks,
            method,
            runs: u32::try_from(relative.len()).unwrap_or(u32::MAX),
            bias: mean(&relative),
            deviation: deviation(&relative),
            rms_error: mean(&squares).sqrt(),
            trials: per_track(if method == Method::QuestPlus { trials[1] } else { trials[0] }),
        }
    };
    Method::ALL.into_iter().zip(&estimates).map(row).collect()
}

/// Runs one track with an observer; returns threshold and answers.
fn walk(
    mut track: Track,
    observer: &TernaryObserver,
    stream: &mut Stream,
) -> (Option<f64>, Vec<Observation>) {
    let mut answers = Vec::new();
    while !track.is_done() {
        let delta = track.delta();
        let larger_second = stream.coin();
        let judgement = match observer.respond(if larger_second { delta } else { -delta }, stream) {
            Some(Position::Second) if larger_second => Judgement::Correct,
            Some(Position::First) if !larger_second => Judgement::Correct,
            Some(_) => Judgement::Wrong,
            None => Judgement::Unsure,
        };
        answers.push(Observation { delta, judgement });
        track.answer(judgement);
    }
    (track.threshold(), answers)
}
