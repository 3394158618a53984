use super::*;
use Judgement::{Correct, Unsure, Wrong};

/// D2/D1 and D3/D1 of Kaernbach's equations for two alternatives.
#[test]
fn step_ratios() {
    let table = [(2.0 / 3.0, 2.0, 0.5), (0.70, 7.0 / 3.0, 2.0 / 3.0), (0.75, 3.0, 1.0), (0.80, 4.0, 1.5)];
    for (target, wrong, unsure) in table {
        let rule = WeightedUpDownRule { target, ..WeightedUpDownRule::default() };
        assert!((rule.wrong_ratio() - wrong).abs() < 1.0e-12);
        assert!((rule.unsure_ratio() - unsure).abs() < 1.0e-12);
    }
}

/// A track by hand: every difference, reversal, halving and the mean.
#[test]
fn a_track_by_hand() {
    let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
    // Answer, difference it was given at (in percent), reversals after it.
    let script = [
        (Correct, 40.0, 0),
        (Correct, 30.0, 0),
        (Wrong, 20.0, 1),   // up by 30
        (Correct, 50.0, 2), // halved to 5, at once
        (Correct, 45.0, 2),
        (Unsure, 40.0, 3),  // up by 5
        (Correct, 45.0, 4), // halved to 2.5; counts from here
        (Correct, 42.5, 4),
        (Unsure, 40.0, 5),
        (Correct, 42.5, 6),
        (Wrong, 40.0, 7), // up by 7.5
        (Correct, 47.5, 8),
    ];
    for (index, (judgement, percent, reversals)) in script.into_iter().enumerate() {
        assert!((track.delta() * 100.0 - percent).abs() < 1.0e-9, "trial {index}: {}", track.delta());
        assert!(!track.is_done());
        let before = track.reversals;
        assert_eq!(track.answer(judgement), reversals > before, "trial {index}");
        assert_eq!(track.reversals, reversals, "trial {index}");
    }
    assert!(track.is_done());
    let mean = (45.0 + 42.5 + 40.0 + 42.5 + 40.0 + 47.5) / 600.0;
    assert!((track.threshold().unwrap() - mean).abs() < 1.0e-12);
}

#[test]
fn what_was_left_open_changes_what_it_says() {
    let threshold = |rule: WeightedUpDownRule| {
        let mut track = WeightedUpDown::new(&rule);
        for judgement in [Wrong, Correct, Wrong, Correct, Wrong, Correct, Wrong, Correct, Wrong] {
            track.answer(judgement);
        }
        track.threshold().unwrap()
    };
    let base = WeightedUpDownRule { initial_delta: 0.3, ..WeightedUpDownRule::default() };
    let with = |change: fn(&mut WeightedUpDownRule)| {
        let mut rule = base.clone();
        change(&mut rule);
        threshold(rule)
    };
    let default = threshold(base.clone());
    assert_ne!(default, with(|rule| rule.averaging = Averaging::AfterFirst));
    assert_ne!(default, with(|rule| rule.averaging = Averaging::BeforeLast));
    assert_ne!(default, with(|rule| rule.step_at_reversal = StepAtReversal::Old));
    assert_ne!(default, with(|rule| rule.ceiling = 0.5));
}

#[test]
fn the_difference_stays_between_floor_and_ceiling_and_an_endless_track_ends() {
    let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
    while !track.is_done() {
        track.answer(Correct);
        assert!(track.delta() >= 0.01, "no pair without a difference is judged");
    }
    assert_eq!((track.trials, track.threshold()), (200, None));
    let mut track = WeightedUpDown::new(&WeightedUpDownRule::default());
    (0..50).for_each(|_| {
        track.answer(Wrong);
    });
    assert_eq!(track.delta(), 0.95);
}

#[test]
fn impossible_settings_are_refused() {
    fn refused(change: impl Fn(&mut WeightedUpDownRule)) -> String {
        let mut rule = WeightedUpDownRule::default();
        change(&mut rule);
        rule.check().unwrap_err().to_string()
    }
    assert_eq!(WeightedUpDownRule::default().check(), Ok(()));
    assert_eq!(refused(|rule| rule.target = 0.5), "--target 0.5: must be above 0.5 (guessing) and below 1");
    assert_eq!(refused(|rule| rule.first_step = f64::NAN), "--step NaN: must be above 0 and below 1");
    assert_eq!(
        refused(|rule| rule.initial_delta = 0.0),
        "--initial 0: must be above --floor (0.01) and up to --ceiling (0.95)"
    );
    for floor in [0.0, -0.1] {
        let said = refused(|rule| rule.floor = floor);
        let legal = "must be above 0 (equal stimuli have no correct answer) and below --ceiling (0.95)";
        assert_eq!(said, format!("--floor {floor}: {legal}"));
    }
    assert_eq!(refused(|rule| rule.average_from = 9), "--average-from 9: must be 1 to --stop-after (8)");
}
