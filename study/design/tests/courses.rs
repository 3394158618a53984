//! Courses: contents, determinism, resumption, and answers that do not fit.

use super::support::{all, delay, design, session, sit};
use flotor_study_design::answer::{Answer, Position, Reply};
use flotor_study_design::course::{Course, Handle, Phase, ReplyError, Signal, Step, Trial};
use flotor_study_design::observer::{Population, SimulatedObserver};
use flotor_study_design::random::{Purpose, Stream};
use flotor_study_design::value::{Setting, Value};
use serde_json::json;
use std::collections::BTreeMap;

fn trials(steps: &[(Step, Reply)]) -> Vec<&Trial> {
    let trial = |(step, _): &'_ (Step, Reply)| matches!(step, Step::Trial(_));
    steps
        .iter()
        .filter(|one| trial(one))
        .filter_map(|(step, _)| if let Step::Trial(trial) = step { Some(trial) } else { None })
        .collect()
}

/// The same seed, subject and session give the same steps, and another of them other ones.
#[test]
fn a_course_follows_from_seed_subject_and_session() {
    for design in all() {
        let of = |seed, subject, number| {
            let (steps, course) = sit(&design, &Population::default(), session(seed, subject, number));
            serde_json::to_string(&(steps, course.results())).expect("JSON")
        };
        let first = of(1, 1, 1);
        assert_eq!(first, of(1, 1, 1));
        for other in [of(2, 1, 1), of(1, 2, 1), of(1, 1, 2)] {
            assert_ne!(first, other, "{}", design.method().word());
        }
    }
}

/// A course broken off anywhere continues as if it had not been: 200 random places over all methods, the answers read back from JSON.
#[test]
fn any_prefix_of_a_log_has_the_same_continuation() {
    let mut stream = Stream::new(77, Purpose::Answer, 1, 1);
    for (index, design) in all().into_iter().enumerate() {
        let name = session(5, u16::try_from(index).expect("small") + 1, 1);
        let (whole, ended) = sit(&design, &Population::default(), name);
        for _ in 0..25 {
            let broken = stream.below(whole.len());
            let text = serde_json::to_string(&whole[..broken]).expect("JSON");
            let log: Vec<(Step, Reply)> = serde_json::from_str(&text).expect("the steps");
            let mut course = Course::new(&design, name);
            for (step, reply) in &log {
                assert_eq!(course.next().as_ref(), Some(step));
                course.answer(reply, Handle::InRange).expect("an answer");
            }
            let observer = SimulatedObserver::new(&Population::default(), name);
            for (step, reply) in &whole[broken..] {
                assert_eq!(course.next().as_ref(), Some(step), "after {broken} steps");
                assert_eq!(&observer.respond(&design, step), reply);
                course.answer(reply, Handle::InRange).expect("an answer");
            }
            assert!(course.is_over() && course.results() == ended.results());
        }
    }
}

/// A design survives its JSON.
#[test]
fn designs_are_read_back() {
    for design in all() {
        let text = serde_json::to_string(&design).expect("JSON");
        assert_eq!(
            serde_json::from_str::<flotor_study_design::design::Design>(&text).expect("a design"),
            design
        );
    }
}

/// Constant stimuli: each level in each cell exactly as often as the file says, comparison first in about half of the trials.
#[test]
fn constant_stimuli_are_complete() {
    let design = design(delay());
    let (mut first, mut all) = (0_u32, 0_u32);
    for subject in 1..=12 {
        let (steps, _) = sit(&design, &Population::default(), session(9, subject, 1));
        let mut cells: BTreeMap<String, u32> = BTreeMap::new();
        for trial in trials(&steps).into_iter().filter(|trial| trial.phase == Phase::Main) {
            *cells.entry(format!("{:?} {:?}", trial.condition, trial.level)).or_default() += 1;
            all += 1;
            first += u32::from(trial.comparison_at == Some(Position::First));
            let [one, other] = &trial.intervals[..] else { panic!("two intervals") };
            let standard = &trial.condition["base"];
            let is_standard = if trial.comparison_at == Some(Position::First) { other } else { one };
            assert_eq!(is_standard, standard);
        }
        assert_eq!((cells.len(), cells.values().all(|count| *count == 3)), (4 * 2 * 4, true));
        assert_eq!(steps.iter().filter(|(step, _)| matches!(step, Step::Form { .. })).count(), 4);
        let practice = trials(&steps).into_iter().filter(|trial| trial.phase == Phase::Practice).count();
        assert_eq!(practice, 3);
        // 99 trials, a rest after each 25 before the next trial.
        assert_eq!(steps.iter().filter(|(step, _)| matches!(step, Step::Rest { .. })).count(), 3);
    }
    let share = f64::from(first) / f64::from(all);
    assert!((share - 0.5).abs() < 4.0 * 0.5 / f64::from(all).sqrt(), "{share}");
}

/// Settings of a trial: those of the condition, then of the stimulus.
#[test]
fn a_trial_names_its_settings() {
    let course = Course::new(&design(delay()), session(1, 1, 1));
    let Some(Step::Trial(trial)) = course.next() else { panic!("a trial") };
    let settings = course.settings(&trial);
    assert_eq!(settings.len(), 2);
    for (interval, value) in settings.iter().zip(&trial.intervals) {
        let [delay, gamma] = &interval[..] else { panic!("{interval:?}") };
        assert_eq!(delay.0.to_string(), "device.delay_ms");
        assert_eq!(
            gamma,
            &(Setting::try_from("spring.gamma_n".to_owned()).expect("a setting"), value.clone())
        );
    }
}

/// A detection has its share of trials without the signal, whose value is the absent one.
#[test]
fn a_detection_has_trials_without_the_signal() {
    let design = all()
        .into_iter()
        .find(|design| design.task().word() == "detection" && design.method().word() == "constant")
        .expect("it");
    let (steps, _) = sit(&design, &Population::default(), session(2, 1, 1));
    let (mut present, mut absent) = (0, 0);
    for trial in trials(&steps).into_iter().filter(|trial| trial.phase == Phase::Main) {
        let expected = match trial.signal {
            Some(Signal::Present) => {
                present += 1;
                "free"
            }
            Some(Signal::Absent) => {
                absent += 1;
                "fixed"
            }
            None => panic!("{trial:?}"),
        };
        assert_eq!(trial.intervals, [Value::Choice(expected.to_owned())]);
    }
    assert_eq!((present, absent), (32, 32));
}

/// Interleaved tracks run side by side, and each ends with a result of its own; successive ones end before the next begins.
#[test]
fn tracks_are_interleaved_or_successive() {
    for order in ["interleaved", "successive"] {
        let mut table = delay();
        table["task"] = json!({ "ask": "choice", "unsure": true });
        table["method"] = json!({ "kind": "quest-plus", "tracks": 2, "rule": { "trials": 10 } });
        table["blocks"]["tracks"] = json!(order);
        let design = design(table);
        let (steps, course) = sit(&design, &Population::default(), session(4, 1, 1));
        let changes = trials(&steps)
            .windows(2)
            .filter(|two| two[0].block == two[1].block && two[0].phase == Phase::Main)
            .filter(|two| two[0].track != two[1].track)
            .count();
        assert_eq!(course.results().len(), 4 * 2 * 2);
        assert!(course.results().iter().all(|result| result.trials == 10 && result.threshold.is_some()));
        let expected = if order == "successive" { 12..=12 } else { 80..=160 };
        assert!(expected.contains(&changes), "{order}: {changes}");
    }
}

/// A trial in which the handle left its range is presented again, the same one, at most three times; its answers do not count.
#[test]
fn a_trial_is_repeated_three_times_at_most() {
    let design = design(delay());
    let mut course = Course::new(&design, session(1, 1, 1));
    let Some(Step::Trial(first)) = course.next() else { panic!("a trial") };
    for repeat in 0..=Course::REPEATS {
        let Some(Step::Trial(trial)) = course.next() else { panic!("a trial") };
        let expected = Trial { number: first.number + repeat, repeat, ..first.clone() };
        assert_eq!(trial, expected);
        course.answer(&Reply::plain(Answer::First), Handle::LeftRange).expect("an answer");
    }
    let Some(Step::Trial(next)) = course.next() else { panic!("a trial") };
    assert_eq!((next.repeat, next.number), (0, Course::REPEATS + 2));
}

/// An answer that does not fit the step changes nothing.
#[test]
fn answers_that_do_not_fit_are_refused() {
    for design in all() {
        let mut course = Course::new(&design, session(1, 1, 1));
        while matches!(course.next(), Some(Step::Form { .. } | Step::Rest { .. })) {
            let reply = SimulatedObserver::new(&Population::default(), session(1, 1, 1))
                .respond(&design, &course.next().expect("a step"));
            course.answer(&reply, Handle::InRange).expect("an answer");
        }
        let before = course.next();
        for wrong in [Answer::Rested, Answer::Form(Vec::new()), Answer::Rating(7.5), Answer::Magnitude(0.0)] {
            let error =
                course.answer(&Reply::plain(wrong.clone()), Handle::InRange).expect_err("it does not fit");
            assert!(matches!(&error, ReplyError::Answer(answer) if *answer == wrong), "{error}");
            assert_eq!(course.next(), before);
        }
        if design.task().confidence.is_some() {
            let error =
                course.answer(&Reply::plain(Answer::First), Handle::InRange).expect_err("no confidence");
            assert_eq!(error, ReplyError::Confidence(None));
        }
    }
}

/// Choices of the simulated observer have the share of the psychometric function, to four standard errors.
#[test]
fn simulated_choices_follow_the_threshold() {
    let mut table = delay();
    table["method"] = json!({ "kind": "constant", "levels": [0.14], "repetitions": 400 });
    let design = design(table);
    let population =
        Population { lapse: 0.0, subject_spread: 0.0, condition_spread: 0.0, ..Population::default() };
    let (steps, _) = sit(&design, &population, session(6, 1, 1));
    let (mut right, mut all) = (0.0, 0.0);
    for (step, reply) in &steps {
        if let Step::Trial(Trial { phase: Phase::Main, comparison_at: Some(at), .. }) = step {
            all += 1.0;
            let named = if *at == Position::First { Answer::First } else { Answer::Second };
            right += f64::from(u8::from(reply.answer == named));
        }
    }
    assert!((right / all - 0.75_f64).abs() < 4.0 * (0.75 * 0.25 / all).sqrt(), "{right} of {all}");
}
