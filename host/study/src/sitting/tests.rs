use super::*;
use crate::procedure::{Procedure, WeightedUpDownRule};
use crate::protocol::MagnitudeProtocol;

fn subject(number: u16) -> SubjectNumber {
    SubjectNumber::new(number).unwrap()
}

/// A subject who always knows.
fn right(trial: &Trial) -> Response {
    match (trial.phase, trial.presented) {
        (Phase::Practice, _) => Response::Seen,
        (_, Presented::One { value }) => Response::Rating(value),
        (_, Presented::Pair(pair)) if pair.larger_at == Position::First => Response::First,
        _ => Response::Second,
    }
}

#[test]
fn a_magnitude_sitting_is_72_trials_and_two_demos() {
    let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
    let mut sitting = Sitting::new(&protocol, 1, subject(2));
    let mut trials = Vec::new();
    while let Some(trial) = sitting.next() {
        assert_eq!(sitting.next(), Some(trial), "asking changes nothing");
        trials.push(trial);
        assert_eq!(sitting.answer(right(&trial), &Exploration::default()), Ok(Verdict::Taken));
    }
    assert!(sitting.is_over());
    let count = |wanted: &dyn Fn(&Trial) -> bool| trials.iter().filter(|trial| wanted(trial)).count();
    assert_eq!(count(&|trial| trial.phase == Phase::Main), 72);
    assert_eq!(count(&|trial| trial.phase == Phase::Practice), 10);
    assert_eq!(trials[0].modality, Modality::H, "an even number starts with haptics alone");
    for modality in Modality::ALL {
        for value in MagnitudeProtocol::default().values {
            let shown = Presented::One { value };
            let times = count(&|t| t.phase == Phase::Main && t.modality == modality && t.presented == shown);
            assert_eq!(times, 3);
        }
    }
    let error = sitting.answer(Response::Rating(1.0), &Exploration::default());
    assert_eq!(error, Err(AnswerError::Over));
}

#[test]
fn a_jnd_sitting_is_twelve_tracks_in_alternating_modality() {
    let mut jnd = JndProtocol::default();
    // Who always knows never turns.
    let rule = WeightedUpDownRule { trials_most: 8, ..WeightedUpDownRule::default() };
    jnd.procedure = Procedure::WeightedUpDown(rule);
    let protocol = Protocol::Jnd(jnd);
    let mut sitting = Sitting::new(&protocol, 1, subject(1));
    let mut modalities = Vec::new();
    while let Some(trial) = sitting.next() {
        if trial.phase == Phase::Main && modalities.len() < trial.replication as usize {
            modalities.push(trial.modality);
        }
        sitting.answer(right(&trial), &Exploration::default()).unwrap();
    }
    assert_eq!(modalities, [Modality::Vh, Modality::H, Modality::Vh, Modality::H]);
    assert_eq!(sitting.results().len(), 12);
    assert!(sitting.results().iter().all(|track| track.trials == 8));
    for modality in Modality::ALL {
        for base in [17.0, 26.0, 35.0] {
            let tracks = sitting.results().iter();
            assert_eq!(tracks.filter(|t| t.modality == modality && t.base == base).count(), 2);
        }
    }
}

/// A trial whose handle left its range comes again, the staircase stays where it was, and at some point it goes on.
#[test]
fn boundary_hits_repeat_a_trial() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut sitting = Sitting::new(&Protocol::Jnd(jnd), 3, subject(5));
    let hit = Exploration { boundary_hit: true, ..Exploration::default() };
    let delta = |sitting: &Sitting| match sitting.next().unwrap().presented {
        Presented::Pair(pair) => pair.delta,
        Presented::One { .. } => f64::NAN,
    };
    for repeat in 0..3 {
        let trial = sitting.next().unwrap();
        assert_eq!((trial.repeat, trial.number), (repeat, repeat + 1));
        assert_eq!(sitting.answer(right(&trial), &hit), Ok(Verdict::Repeated));
        assert_eq!(delta(&sitting), 0.4);
    }
    let trial = sitting.next().unwrap();
    assert!(matches!(sitting.answer(right(&trial), &hit), Ok(Verdict::Judged { .. })));
    assert!((delta(&sitting) - 0.3).abs() < 1.0e-12);
}

#[test]
fn answers_of_the_wrong_kind_change_nothing() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut sitting = Sitting::new(&Protocol::Jnd(jnd), 3, subject(5));
    let trial = sitting.next();
    for wrong in [Response::Rating(3.0), Response::Seen] {
        assert_eq!(sitting.answer(wrong, &Exploration::default()), Err(AnswerError::Kind(wrong)));
    }
    assert_eq!(sitting.next(), trial);
    let mut rating = Sitting::new(&Protocol::Magnitude(MagnitudeProtocol::default()), 3, subject(5));
    for _ in 0..5 {
        rating.answer(Response::Seen, &Exploration::default()).unwrap();
    }
    let error = rating.answer(Response::Rating(f64::NAN), &Exploration::default());
    assert_eq!(error, Err(AnswerError::NotFinite));
}
