use super::*;
use crate::protocol::MagnitudeProtocol;
use flotor_study_design::procedure::{Procedure, WeightedUpDownRule};

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

/// Catch trials have no difference, repeated ones are to the bit what was there before; both are placed by the seed, and the
/// track goes on as if they had not been.
#[test]
fn checks_are_placed_by_the_seed_and_do_not_count() {
    use crate::protocol::Checks;
    let with = |checks| Protocol::Jnd(JndProtocol { checks, ..JndProtocol::default() });
    let sit = |protocol: &Protocol, seed| {
        let mut sitting = Sitting::new(protocol, seed, subject(3));
        let mut trials: Vec<Trial> = Vec::new();
        while let Some(trial) = sitting.next() {
            let verdict = sitting.answer(unsure_below(&trial, 0.1), &Exploration::default()).unwrap();
            let is_check = matches!(trial.phase, Phase::Catch | Phase::RepeatCheck);
            assert!(!is_check || verdict == Verdict::Taken);
            trials.push(trial);
        }
        (trials, sitting.results().to_vec())
    };
    let protocol = with(Checks { catch: 1, repeats: 2, obvious: None });
    let (trials, results) = sit(&protocol, 5);
    assert_eq!(sit(&protocol, 5).0, trials, "the same seed, the same places");
    assert_eq!(sit(&with(Checks::default()), 5).1.len(), results.len());
    let places = |trials: &[Trial]| {
        let is_check = |(place, trial): (usize, &Trial)| (trial.phase != Phase::Main).then_some(place);
        trials.iter().enumerate().filter_map(is_check).collect::<Vec<_>>()
    };
    assert_ne!(places(&trials), places(&sit(&protocol, 6).0), "another seed, other places");
    for track in 1..=12 {
        let here: Vec<&Trial> = trials.iter().filter(|trial| trial.track == track).collect();
        let count = |phase| here.iter().filter(|trial| trial.phase == phase).count();
        assert_eq!((count(Phase::Catch), count(Phase::RepeatCheck)), (1, 2), "track {track}");
        assert_eq!(here[0].phase, Phase::Main);
        for (place, trial) in here.iter().enumerate() {
            let Presented::Pair(pair) = trial.presented else { panic!("{trial:?}") };
            if trial.phase == Phase::Catch {
                assert_eq!((pair.delta, pair.base), (0.0, pair.comparison));
            }
            if trial.phase == Phase::RepeatCheck {
                let before = here[..place].iter().filter(|other| other.phase == Phase::Main);
                assert!(before.clone().any(|other| other.presented == trial.presented), "{trial:?}");
            }
        }
    }
    // Which of a pair comes first is drawn by the number of the trial: only the differences can be compared.
    let deltas = |trials: &[Trial]| {
        let main = trials.iter().filter(|trial| trial.phase == Phase::Main);
        main.filter_map(|trial| match trial.presented {
            Presented::Pair(pair) => Some(pair.delta),
            Presented::One { .. } => None,
        })
        .collect::<Vec<_>>()
    };
    assert_eq!(deltas(&trials), deltas(&sit(&with(Checks::default()), 5).0));
}

/// A repeat check whose handle left its range comes again with the pair that it was to repeat.
#[test]
fn a_repeat_check_comes_again_with_its_pair() {
    let checks = crate::protocol::Checks { catch: 0, repeats: 3, obvious: None };
    let mut jnd = JndProtocol { checks, ..JndProtocol::default() };
    jnd.demo.shown = false;
    let mut sitting = Sitting::new(&Protocol::Jnd(jnd), 3, subject(5));
    let (mut before, mut again): (Option<Trial>, u32) = (None, 0);
    while let Some(trial) = sitting.next() {
        let is_check = trial.phase == Phase::RepeatCheck;
        if let Some(before) = before.filter(|_| is_check && trial.repeat > 0) {
            assert_eq!(trial.presented, before.presented, "{trial:?}");
            again += 1;
        }
        let exploration = Exploration { boundary_hit: is_check, ..Exploration::default() };
        sitting.answer(unsure_below(&trial, 0.1), &exploration).unwrap();
        before = Some(trial);
    }
    assert_eq!(again, 12 * 3 * 3, "each of them comes again as often as a trial may");
}

/// Right where the difference is large, else "I don't know".
fn unsure_below(trial: &Trial, least: f64) -> Response {
    match trial.presented {
        Presented::Pair(pair) if trial.phase != Phase::Practice && pair.delta < least => Response::DontKnow,
        _ => right(trial),
    }
}

#[test]
fn a_rating_is_asked_for_once_more_and_not_right_after() {
    let magnitude = MagnitudeProtocol { repeat_checks: 3, ..MagnitudeProtocol::default() };
    let mut sitting = Sitting::new(&Protocol::Magnitude(magnitude), 1, subject(2));
    let mut trials = Vec::new();
    while let Some(trial) = sitting.next() {
        trials.push(trial);
        sitting.answer(right(&trial), &Exploration::default()).unwrap();
    }
    let main = trials.iter().filter(|trial| trial.phase == Phase::Main).count();
    let checks: Vec<usize> =
        (0..trials.len()).filter(|place| trials[*place].phase == Phase::RepeatCheck).collect();
    assert_eq!((main, checks.len()), (72, 18));
    for place in checks {
        let check = trials[place];
        let same = |other: &Trial| {
            other.phase == Phase::Main
                && (other.modality, other.replication) == (check.modality, check.replication)
                && other.presented == check.presented
        };
        let first = trials[..place].iter().rposition(same).expect("it was presented before");
        assert!(trials[first + 1..place].iter().any(|other| other.phase == Phase::Main), "{check:?}");
    }
}
