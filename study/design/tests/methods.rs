//! Targets of the methods, on observers with closed forms.

use flotor_statistics::distribution::normal_below;
use flotor_study_design::answer::Judgement;
use flotor_study_design::method::{
    Direction, Limits, Outcome, Staircase, StaircaseRule, TargetRating, TargetRatingRule,
};
use flotor_study_design::procedure::{WeightedUpDown, WeightedUpDownRule};
use flotor_study_design::random::{Purpose, Stream};

/// Returns the mean and its standard error.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Returns the level at which an increasing function is `target`.
fn level_of(target: f64, of: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if of(middle) < target { low = middle } else { high = middle }
    }
    high
}

/// Share of positive outcomes at a level: a cumulative normal without lapses.
fn positive(level: f64) -> f64 {
    normal_below((level - 2.0) / 0.5)
}

/// With small steps the levels of a track have their mean at the target, to a tenth of the spread of the observer: the equilibrium of the
/// expected steps.
#[test]
fn staircases_converge_to_their_target() {
    for (down_after, step_down, step_up) in
        [(1, 0.02, 0.02), (2, 0.02, 0.02), (3, 0.02, 0.02), (2, 0.03, 0.015)]
    {
        let rule = StaircaseRule {
            initial: 3.0,
            down_after,
            step_down,
            step_up,
            halve_at: Vec::new(),
            stop_after: 4000,
            average_from: 200,
            floor: 0.0,
            ceiling: 5.0,
            trials_most: 1_000_000,
        };
        let mut track = Staircase::new(&rule);
        let mut stream = Stream::new(1, Purpose::Answer, 1, down_after);
        while !track.is_done() {
            let outcome = if stream.uniform() < positive(track.level()) {
                Outcome::Positive
            } else {
                Outcome::Negative
            };
            track.answer(outcome);
        }
        let expected = level_of(rule.target(), positive);
        let found = track.threshold().expect("a threshold");
        assert!(
            (found - expected).abs() < 0.05,
            "{down_after} {step_up}/{step_down}: {found} for {expected}"
        );
    }
    assert!((StaircaseRule::default().target() - 0.5_f64.sqrt()).abs() < 1.0e-15);
}

/// The weighted up-down rule balances at the target of the rule, here for detections: P(yes) = p.
#[test]
fn weighted_up_down_converges_to_its_target() {
    for target in [0.6, 0.75, 0.9] {
        let rule = WeightedUpDownRule {
            initial_delta: 3.0,
            first_step: 0.01,
            target,
            halve_at: Vec::new(),
            stop_after: 4000,
            average_from: 200,
            floor: 0.0,
            ceiling: 5.0,
            trials_most: 1_000_000,
            ..WeightedUpDownRule::default()
        };
        let mut track = WeightedUpDown::new(&rule);
        let mut stream = Stream::new(2, Purpose::Answer, 1, 1);
        while !track.is_done() {
            let is_right = stream.uniform() < positive(track.delta());
            track.answer(if is_right { Judgement::Correct } else { Judgement::Wrong });
        }
        let (found, expected) = (track.threshold().expect("a threshold"), level_of(target, positive));
        assert!((found - expected).abs() < 0.05, "{target}: {found} for {expected}");
    }
}

/// Ratings `2 + 3 x` plus noise: the level of the target is closed; the mean of many tracks is at it.
#[test]
fn ratings_converge_to_their_target() {
    for (target, slope, gain) in [(4.0, 3.0, 0.2), (4.0, -3.0, -0.2), (3.0, 3.0, 0.2)] {
        let rule = TargetRatingRule {
            target,
            initial: 0.5 * f64::signum(slope),
            gain,
            trials: 200,
            floor: -3.0,
            ceiling: 3.0,
        };
        let track = |index| {
            let mut track = TargetRating::new(&rule);
            let mut stream = Stream::new(3, Purpose::Answer, 1, index);
            while !track.is_done() {
                let rating = 2.0 + slope * track.level() + 0.8 * stream.normal();
                track.answer(Outcome::Rated(rating));
            }
            track.threshold().expect("a threshold")
        };
        let (mean, error) = mean_and_error(&(0..400).map(track).collect::<Vec<_>>());
        let expected = (target - 2.0) / slope;
        assert!((mean - expected).abs() < 4.0 * error && error < 0.01, "{mean} for {expected}, {error}");
    }
}

/// An observer without noise changes the answer between the two levels around the threshold, in both directions; a series without a
/// change has no threshold.
#[test]
fn series_end_at_the_change_of_the_answer() {
    let levels = [0.1, 0.2, 0.3, 0.4, 0.5];
    for (threshold, expected) in [(0.25, Some(0.25)), (0.41, Some(0.45)), (0.05, None), (0.6, None)] {
        for direction in [Direction::Ascending, Direction::Descending] {
            let mut series = Limits::new(&levels, direction);
            let mut trials = 0;
            while !series.is_done() {
                let is_above = series.level() > threshold;
                series.answer(if is_above { Outcome::Positive } else { Outcome::Negative });
                trials += 1;
            }
            let found = series.threshold();
            assert!(trials <= levels.len());
            assert_eq!(found.is_some(), expected.is_some(), "{threshold} {direction:?}");
            if let (Some(found), Some(expected)) = (found, expected) {
                assert!((found - expected).abs() < 1.0e-12, "{threshold} {direction:?}: {found}");
            }
        }
    }
    assert_eq!(Direction::of_series(0), Direction::Ascending);
    assert_eq!(Direction::of_series(1), Direction::Descending);
}
