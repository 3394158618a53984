//! Screens of a person's session: every step in order, no effect of wrong inputs.

use super::*;
use flotor_study_design::course::Session;
use flotor_study_design::design::Design;
use flotor_study_design::subject::SubjectNumber;
use serde_json::json;

fn design() -> Design {
    serde_json::from_value(json!({
        "study": "small",
        "factor": [{ "name": "picture", "setting": "picture", "values": ["shown", "hidden"] }],
        "stimulus": { "setting": "spring.gamma_n", "standard": 26 },
        "task": { "ask": "choice", "confidence": { "least": 1, "most": 5 } },
        "method": { "kind": "constant", "levels": [0.1, 0.3], "repetitions": 2 },
        "blocks": { "by": ["picture"], "order": "alternate", "practice": 1, "rest_every": 3 },
        "questionnaire": [
            { "at": "start", "item": [{ "answer": "text", "key": "hand", "text": "Your hand?" }] },
            { "at": "after-block", "title": "Load", "form": "nasa-tlx" },
        ],
    }))
    .unwrap()
}

fn attended() -> AttendedCourse {
    let session = Session { seed: 3, subject: SubjectNumber::new(1).unwrap(), session: 1 };
    AttendedCourse::new(Course::new(&design(), session))
}

/// Returns a valid input to a screen.
fn right(screen: &Screen) -> Input {
    match screen {
        Screen::Read { .. } | Screen::Ready { .. } | Screen::Feel { .. } | Screen::Over => Input::Continue,
        Screen::Ask { .. } => Input::Answer(Answer::Second),
        Screen::Confidence { scale } => Input::Point(scale.least),
        Screen::Item { item: flotor_study_design::form::Item::Text { .. }, .. } => {
            Input::Item(Value::Choice("right".to_owned()))
        }
        Screen::Item { .. } => Input::Item(Value::Number(50.0)),
    }
}

/// The steps that are logged are those of the course, and each pause has its reason.
#[test]
fn a_person_sees_every_step_of_the_course() {
    let mut person = attended().after_reading(["Consent".to_owned()]);
    let mut replay = person.course().clone();
    let (mut pauses, mut items, mut intervals) = (Vec::new(), 0, 0);
    while person.screen() != Screen::Over {
        let screen = person.screen();
        match &screen {
            Screen::Ready { reason, .. } => pauses.push(*reason),
            Screen::Item { .. } => items += 1,
            Screen::Feel { .. } => {
                intervals += 1;
                assert_eq!(person.interval().unwrap().1.len(), 2);
            }
            _ => assert_eq!(person.interval(), None),
        }
        if let Effect::Answered(event) = person.input(right(&screen), 0.5).unwrap() {
            assert_eq!(replay.next(), Some(event.step));
            replay.answer(&event.reply, flotor_study_design::course::Handle::InRange).unwrap();
        }
    }
    assert!(replay.is_over());
    // 1 practice trial and two blocks of 2 levels, each presented twice; two intervals in each trial.
    assert_eq!((intervals, items), (18, 1 + 2 * 6));
    let count = |reason: Pause| pauses.iter().filter(|pause| **pause == reason).count();
    // Both blocks begin after a questionnaire; 9 trials with a rest after every third one.
    assert_eq!(
        (count(Pause::Start), count(Pause::PhaseChanges), count(Pause::Rest)),
        (2, 1, 2),
        "{pauses:?}"
    );
}

#[test]
fn wrong_inputs_change_nothing() {
    let mut person = attended();
    let mut seen = 0;
    while person.screen() != Screen::Over && seen < 30 {
        let screen = person.screen();
        let wrong = match &screen {
            Screen::Ask { .. } => vec![Input::Continue, Input::Answer(Answer::Unsure), Input::Point(1.0)],
            Screen::Confidence { .. } => vec![Input::Point(9.0), Input::Answer(Answer::First)],
            Screen::Item { .. } => vec![Input::Item(Value::Number(51.0)), Input::Continue],
            _ => vec![Input::Answer(Answer::First), Input::Point(1.0), Input::Item(Value::Number(1.0))],
        };
        for input in wrong {
            person.input(input.clone(), 0.1).expect_err(&format!("{input:?} at {screen:?}"));
            assert_eq!(person.screen(), screen);
        }
        person.input(right(&screen), 0.1).unwrap();
        seen += 1;
    }
}

#[test]
fn a_trial_is_felt_again_up_to_the_limit() {
    let mut person = attended().with_again_at_most(Some(1));
    while !matches!(person.screen(), Screen::Ask { .. }) {
        let input = right(&person.screen());
        person.input(input, 0.1).unwrap();
    }
    assert!(matches!(person.screen(), Screen::Ask { again: Again::Left(1), .. }));
    person.input(Input::Again, 0.1).unwrap();
    assert!(matches!(person.screen(), Screen::Feel { interval: 1, .. }));
    person.input(Input::Continue, 0.1).unwrap();
    person.input(Input::Continue, 0.1).unwrap();
    assert!(matches!(person.screen(), Screen::Ask { again: Again::Left(0), .. }));
    assert!(person.input(Input::Again, 0.1).is_err());
}
