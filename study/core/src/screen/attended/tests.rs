use super::*;
use crate::protocol::{JndProtocol, MagnitudeProtocol, SubjectNumber};
use crate::trial::Phase;

fn attended(protocol: &Protocol, rest_every: u32) -> ScreenStateMachine {
    let sitting = Sitting::new(protocol, 4, SubjectNumber::new(1).unwrap());
    ScreenStateMachine::new(sitting, protocol, rest_every)
}

/// A whole sitting through the screens gives the trials of the bare state machine, in its order.
#[test]
fn screens_lead_through_every_trial_of_the_sitting() {
    let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
    let mut person = attended(&protocol, 10);
    let mut bare = Sitting::new(&protocol, 4, SubjectNumber::new(1).unwrap());
    let (mut pauses, mut felt, mut answered) = (Vec::new(), 0, 0);
    loop {
        let screen = person.screen();
        assert_eq!(screen, person.screen(), "looking changes nothing");
        let input = match screen {
            Screen::Over => break,
            Screen::Read { .. } => unreachable!("no text was given"),
            Screen::Ready { reason, .. } => {
                pauses.push(reason);
                Input::Continue
            }
            Screen::Feel { position, .. } => {
                assert_eq!(position, None);
                let (trial, value) = person.stimulus().unwrap();
                assert_eq!((Some(trial), trial.presented), (bare.next(), Presented::One { value }));
                felt += 1;
                Input::Continue
            }
            Screen::Ask { question, trial } => {
                assert_eq!((question, trial.quality), (Question::HowMuch, Quality::Stiffness));
                Input::Answer { response: Response::Rating(3.0) }
            }
        };
        if let Step::Answered(event) = person.input(input, 0.5).unwrap() {
            assert_eq!(bare.answer(event.response, &event.exploration), Ok(event.verdict));
            assert_eq!(event.exploration.response_time_s, Some(0.5));
            answered += 1;
        }
    }
    assert_eq!((felt, answered, bare.is_over()), (82, 82, true));
    assert_eq!(pauses.iter().filter(|pause| **pause == Pause::Welcome).count(), 1);
    assert_eq!(pauses.iter().filter(|pause| **pause == Pause::PhaseChanges).count(), 3);
    assert!(pauses.iter().filter(|pause| **pause == Pause::Rest).count() >= 6, "{pauses:?}");
}

#[test]
fn what_does_not_fit_the_screen_changes_nothing() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut person = attended(&Protocol::Jnd(jnd), 0);
    let wrong = |person: &mut ScreenStateMachine, input: Input| {
        let before = person.screen();
        assert!(person.input(input, 0.0).is_err());
        assert_eq!(person.screen(), before);
    };
    let answer = |response| Input::Answer { response };
    wrong(&mut person, answer(Response::First));
    wrong(&mut person, Input::Again);
    person.input(Input::Continue, 0.0).unwrap();
    assert!(matches!(person.screen(), Screen::Feel { position: Some(Position::First), .. }));
    wrong(&mut person, answer(Response::First));
    person.input(Input::Continue, 0.0).unwrap();
    person.input(Input::Continue, 0.0).unwrap();
    wrong(&mut person, Input::Continue);
    wrong(&mut person, answer(Response::Rating(1.0)));
    // Once more, then an answer; a note in between.
    person.input(Input::Again, 0.0).unwrap();
    assert!(matches!(person.screen(), Screen::Feel { position: Some(Position::First), .. }));
    let note = Input::Note { text: "dog barked".to_owned() };
    assert_eq!(person.input(note, 0.0), Ok(Step::Note("dog barked".to_owned())));
    person.input(Input::Continue, 0.0).unwrap();
    person.input(Input::Continue, 0.0).unwrap();
    assert!(matches!(person.input(answer(Response::DontKnow), 1.0), Ok(Step::Answered(_))));
    assert_eq!(person.input(Input::Stop, 0.0), Ok(Step::Stopped));
}

/// A handle out of its range: the person is told, and the same trial comes again.
#[test]
fn out_of_range_is_said_and_repeated() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut person = attended(&Protocol::Jnd(jnd), 0);
    person.input(Input::Continue, 0.0).unwrap();
    person.record_exploration(StimulusExploration { kinematics: None, boundary_hit: true, missed_ticks: 2 });
    person.input(Input::Continue, 0.0).unwrap();
    person.input(Input::Continue, 0.0).unwrap();
    let step = person.input(Input::Answer { response: Response::First }, 0.0).unwrap();
    let Step::Answered(event) = step else { panic!("{step:?}") };
    assert_eq!((event.verdict, event.exploration.missed_ticks), (Verdict::Repeated, 2));
    assert!(matches!(person.screen(), Screen::Ready { reason: Pause::OutOfRange, .. }));
}

#[test]
fn screens_and_inputs_travel_as_json_without_a_stimulus() {
    let mut person = attended(&Protocol::Jnd(JndProtocol::default()), 0);
    person.input(Input::Continue, 0.0).unwrap();
    let screen = person.screen();
    let text = serde_json::to_string(&screen).unwrap();
    assert_eq!(serde_json::from_str::<Screen>(&text).unwrap(), screen);
    let (_, value) = person.stimulus().unwrap();
    assert!(!text.contains(&value.to_string()), "{text}");
    assert!(!text.contains("condition") && !text.contains("code"), "a code is the stimulus: {text}");
    let rating = r#"{"input":"answer","response":{"rating":7.5}}"#;
    let expected = Input::Answer { response: Response::Rating(7.5) };
    assert_eq!(serde_json::from_str::<Input>(rating).unwrap(), expected);
    assert_eq!(serde_json::from_str::<Input>(r#"{"input":"continue"}"#).unwrap(), Input::Continue);
}

/// Practice asks what will count, and its answer does not; a rating is above 0 from the keyboard on.
#[test]
fn practice_asks_the_question_and_a_rating_is_above_0() {
    let mut person = attended(&Protocol::Magnitude(MagnitudeProtocol::default()), 0);
    person.input(Input::Continue, 0.0).unwrap();
    person.input(Input::Continue, 0.0).unwrap();
    let Screen::Ask { question, trial } = person.screen() else { panic!("{:?}", person.screen()) };
    assert_eq!((question, trial.phase), (Question::HowMuch, Phase::Practice));
    assert!(person.input(Input::Continue, 0.0).is_err());
    for rating in [0.0, -2.0] {
        let answer = Input::Answer { response: Response::Rating(rating) };
        assert_eq!(person.input(answer, 0.0), Err(InputError::NotAbove0));
    }
    let answer = Input::Answer { response: Response::Rating(0.5) };
    let Ok(Step::Answered(event)) = person.input(answer, 0.0) else { panic!("not taken") };
    assert_eq!(event.verdict, Verdict::Taken);
}

/// A consent comes first, then the instructions; who does not go on has felt nothing.
#[test]
fn texts_are_read_before_the_first_trial() {
    let texts = || ["Consent\nI agree.".to_owned(), "How it goes".to_owned()];
    let start = || attended(&Protocol::Jnd(JndProtocol::default()), 0).after_reading(texts());
    let mut person = start();
    for text in texts() {
        assert_eq!(person.screen(), Screen::Read { text: text.clone() });
        assert!(person.input(Input::Again, 0.0).is_err() && person.stimulus().is_none());
        assert_eq!(person.input(Input::Continue, 0.0), Ok(Step::Read(text)));
    }
    assert!(matches!(person.screen(), Screen::Ready { reason: Pause::Welcome, .. }));
    let mut person = start();
    assert_eq!((person.input(Input::Stop, 0.0), person.presented()), (Ok(Step::Stopped), 0));
}

/// A limit on feeling again holds for each trial, is known before it is reached, and is not counted over trials.
#[test]
fn a_trial_is_felt_again_no_more_often_than_the_study_allows() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut person = attended(&Protocol::Jnd(jnd.clone()), 0).with_again_at_most(2);
    let feel = |person: &mut ScreenStateMachine| {
        person.input(Input::Continue, 0.0).unwrap();
        person.input(Input::Continue, 0.0).unwrap();
    };
    let may = |person: &ScreenStateMachine| match person.screen() {
        Screen::Ask { trial, .. } => trial.may,
        other => panic!("{other:?}"),
    };
    person.input(Input::Continue, 0.0).unwrap();
    for _ in 0..2 {
        for left in [2, 1] {
            feel(&mut person);
            assert_eq!(may(&person), [May::Again { left: Some(left) }]);
            person.input(Input::Again, 0.0).unwrap();
        }
        feel(&mut person);
        assert_eq!(may(&person), []);
        assert!(matches!(person.input(Input::Again, 0.0), Err(InputError::NotNow(_))));
        let answer = Input::Answer { response: Response::First };
        assert!(matches!(person.input(answer, 0.0), Ok(Step::Answered(_))));
    }
    let mut person = attended(&Protocol::Jnd(jnd), 0);
    person.input(Input::Continue, 0.0).unwrap();
    feel(&mut person);
    assert_eq!(may(&person), [May::Again { left: None }]);
}

/// A mistyped answer is taken back once, as long as the next stimulus was not felt: the sitting stands where it would stand without
/// it, and the times to both answers are one.
#[test]
fn an_answer_is_taken_back_once_and_before_the_next_stimulus() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let protocol = Protocol::Jnd(jnd);
    let mut person = attended(&protocol, 0);
    let mut bare = Sitting::new(&protocol, 4, SubjectNumber::new(1).unwrap());
    let answer = |response| Input::Answer { response };
    let feel = |person: &mut ScreenStateMachine| {
        person.input(Input::Continue, 0.0).unwrap();
        person.record_exploration(StimulusExploration {
            kinematics: None,
            boundary_hit: false,
            missed_ticks: 1,
        });
        person.input(Input::Continue, 0.0).unwrap();
    };
    let refused = |person: &mut ScreenStateMachine| {
        let before = person.screen();
        assert!(matches!(person.input(Input::Withdraw, 1.0), Err(InputError::NotNow(_))));
        assert_eq!(person.screen(), before);
    };
    refused(&mut person);
    person.input(Input::Continue, 0.0).unwrap();
    refused(&mut person);
    feel(&mut person);
    refused(&mut person);
    let asked = person.screen();
    assert!(matches!(person.input(answer(Response::First), 1.0), Ok(Step::Answered(_))));
    let Screen::Feel { trial, .. } = person.screen() else { panic!("{:?}", person.screen()) };
    assert_eq!(trial.may, [May::Withdraw]);
    assert_eq!(person.input(Input::Withdraw, 0.5), Ok(Step::Withdrawn(1)));
    assert_eq!((person.screen(), person.presented()), (asked, 0));
    refused(&mut person);
    let Ok(Step::Answered(event)) = person.input(answer(Response::Second), 2.0) else { panic!("not taken") };
    assert_eq!((event.exploration.response_time_s, event.exploration.missed_ticks), (Some(3.0), 1));
    assert_eq!(bare.answer(event.response, &event.exploration), Ok(event.verdict));
    assert_eq!(person.stimulus().map(|(trial, _)| trial), bare.next(), "as if the first answer had not been");
    refused(&mut person); // once
    feel(&mut person);
    assert!(matches!(person.input(answer(Response::First), 1.0), Ok(Step::Answered(_))));
    person.input(Input::Continue, 0.0).unwrap();
    refused(&mut person); // the first of the next pair was felt
}

/// Who goes on after a break may practise first, in the modality that comes next: told, and no part of the sitting.
#[test]
fn practice_is_offered_before_a_sitting_goes_on() {
    for protocol in [Protocol::Jnd(JndProtocol::default()), Protocol::Magnitude(MagnitudeProtocol::default())]
    {
        let mut sitting = Sitting::new(&protocol, 4, SubjectNumber::new(1).unwrap());
        assert_eq!(sitting.practice(), [], "practice comes next anyway");
        let response = |trial: &Trial| match trial.presented {
            Presented::One { .. } => Response::Rating(2.0),
            Presented::Pair(_) => Response::First,
        };
        while sitting.next().unwrap().phase == Phase::Practice {
            let trial = sitting.next().unwrap();
            sitting.answer(response(&trial), &Exploration::default()).unwrap();
        }
        let next = sitting.next();
        let mut person = ScreenStateMachine::new(sitting, &protocol, 0).with_practice_offered();
        let before = person.presented();
        let Screen::Ready { reason: Pause::Welcome, next: welcome } = person.screen() else {
            panic!("ready")
        };
        assert_eq!(welcome.may, [May::Practise]);
        person.input(Input::Practise, 0.0).unwrap();
        assert!(matches!(person.input(Input::Practise, 0.0), Err(InputError::NotNow(_))));
        let mut message = 0;
        loop {
            match person.screen() {
                Screen::Ready { reason, next } => {
                    assert_eq!(reason, Pause::PhaseChanges);
                    if next.phase == Phase::Main {
                        break;
                    }
                    person.input(Input::Continue, 0.0).unwrap();
                }
                Screen::Feel { trial, .. } => {
                    assert_eq!(
                        (trial.phase, trial.number, &trial.may),
                        (Phase::Practice, before + 1, &vec![])
                    );
                    assert_eq!(trial.object_is_shown, welcome.object_is_shown);
                    person.input(Input::Continue, 0.0).unwrap();
                }
                Screen::Ask { .. } => {
                    let (wrong, right) = match protocol {
                        Protocol::Jnd(_) => (Response::Rating(2.0), Response::First),
                        Protocol::Magnitude(_) => (Response::First, Response::Rating(2.0)),
                    };
                    assert!(person.input(Input::Answer { response: wrong }, 0.0).is_err());
                    let step = person.input(Input::Answer { response: right }, 0.0);
                    assert!(
                        matches!(&step, Ok(Step::Practised(text)) if text.contains("presented")),
                        "{step:?}"
                    );
                    message += 1;
                }
                Screen::Over | Screen::Read { .. } => unreachable!("it goes on"),
            }
        }
        assert_eq!(message, if matches!(protocol, Protocol::Jnd(_)) { 3 } else { 5 });
        assert_eq!((person.presented(), person.sitting.next()), (before, next));
    }
}
