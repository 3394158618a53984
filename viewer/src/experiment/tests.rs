//! The window's part, with the experiment's own state machine on the other side.

use super::{Prompt, StudyKey};
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, Protocol, SubjectNumber};
use flotor_study::screen::{Input, Screen, ScreenStateMachine, Step, Warning, WindowMessage, WindowReply};
use flotor_study::sitting::Sitting;
use flotor_study::trial::{Position, Response};
use std::sync::mpsc::{Receiver, Sender, channel};

/// A window and an experiment, without programs between them.
struct Both {
    prompt: Prompt,
    experiment: ScreenStateMachine,
    teller: Sender<WindowMessage>,
    hears: Receiver<WindowReply>,
    answers: Vec<Response>,
}

impl Both {
    fn new(protocol: &Protocol, subject: u16) -> Self {
        let sitting = Sitting::new(protocol, 1, SubjectNumber::new(subject).unwrap());
        let ((teller, told), (said, hears)) = (channel(), channel());
        let prompt = Prompt::new(told, said);
        let experiment = ScreenStateMachine::new(sitting, protocol, 30);
        let mut both = Self { prompt, experiment, teller, hears, answers: Vec::new() };
        both.tell();
        both
    }

    fn tell(&mut self) {
        self.teller.send(WindowMessage::Screen(self.experiment.screen())).unwrap();
        self.prompt.poll();
    }

    /// Presses a key; whether the experiment went on.
    fn press(&mut self, key: StudyKey) -> bool {
        self.prompt.key(key);
        let Ok(WindowReply::Input(input)) = self.hears.try_recv() else { return false };
        assert!(!self.prompt.is_persons_turn(), "one answer for one screen");
        self.prompt.key(StudyKey::Enter);
        assert!(self.hears.try_recv().is_err(), "nothing more is said before the next screen");
        if let Step::Answered(event) = self.experiment.input(input, 0.5).unwrap() {
            self.answers.push(event.response);
        }
        self.tell();
        true
    }
}

#[test]
fn a_magnitude_sitting_goes_from_welcome_to_thanks_by_keyboard() {
    let mut both = Both::new(&Protocol::Magnitude(MagnitudeProtocol::default()), 1);
    let (mut felt, mut hidden) = (0, 0);
    while let Some(screen) = both.prompt.screen().cloned().filter(|screen| *screen != Screen::Over) {
        match screen {
            Screen::Feel { trial, .. } => {
                felt += 1;
                assert_eq!(both.prompt.shows_scene(), trial.object_is_shown);
                hidden += u32::from(!trial.object_is_shown);
                assert!(!both.press(StudyKey::Digit(3)) && both.press(StudyKey::Enter));
            }
            Screen::Ready { .. } => assert!(both.press(StudyKey::Enter)),
            Screen::Ask { trial, .. } => {
                assert!(!both.prompt.shows_scene(), "{trial:?}");
                assert!(!both.press(StudyKey::Enter), "practice asks, too, and nothing was typed");
                [StudyKey::Digit(4), StudyKey::Digit(2), StudyKey::Back, StudyKey::Point, StudyKey::Digit(5)]
                    .iter()
                    .for_each(|key| assert!(!both.press(*key)));
                assert_eq!(both.prompt.typed(), "4.5");
                assert!(both.press(StudyKey::Enter) && both.prompt.typed().is_empty());
            }
            Screen::Over | Screen::Read { .. } => unreachable!("it ends the loop"),
        }
    }
    assert_eq!((felt, hidden), (82, 41), "72 trials and two demos of 5, half of them without vision");
    let rated = both.answers.iter().filter(|answer| **answer == Response::Rating(4.5)).count();
    assert_eq!((rated, both.answers.len()), (82, 82), "72 that count, and those to practise");
}

#[test]
fn a_pair_is_felt_one_after_the_other_again_if_wanted_and_answered_by_number() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut both = Both::new(&Protocol::Jnd(jnd), 2);
    assert!(both.press(StudyKey::Enter));
    for (digit, response) in [(0, Response::DontKnow), (1, Response::First), (2, Response::Second)] {
        for round in 0..2 {
            for expected in [Position::First, Position::Second] {
                let screen = both.prompt.screen().cloned();
                assert!(matches!(screen, Some(Screen::Feel { position: Some(at), .. }) if at == expected));
                assert!(!both.press(StudyKey::Again) && both.press(StudyKey::Enter));
            }
            if round == 0 {
                assert!(!both.press(StudyKey::Digit(7)), "7 is no answer");
                assert!(both.press(StudyKey::Again));
            }
        }
        assert!(both.press(StudyKey::Digit(digit)));
        assert_eq!(both.answers.last(), Some(&response));
    }
}

/// U takes the last answer back while the next stimulus was not felt, and means nothing where it may not be done.
#[test]
fn an_answer_is_taken_back_by_a_key() {
    let mut jnd = JndProtocol::default();
    jnd.demo.shown = false;
    let mut both = Both::new(&Protocol::Jnd(jnd), 2);
    assert!(!both.press(StudyKey::Withdraw) && both.press(StudyKey::Enter));
    assert!(both.press(StudyKey::Enter) && both.press(StudyKey::Enter));
    assert!(!both.press(StudyKey::Withdraw) && both.press(StudyKey::Digit(1)));
    assert!(both.press(StudyKey::Withdraw), "{:?}", both.prompt.screen());
    assert!(matches!(both.prompt.screen(), Some(Screen::Ask { trial, .. }) if trial.number == 1));
    assert!(!both.press(StudyKey::Withdraw) && both.press(StudyKey::Digit(2)));
    assert!(!both.press(StudyKey::Withdraw), "once");
    assert_eq!(both.answers, [Response::First, Response::Second]);
}

#[test]
fn warnings_and_refusals_leave_the_screen_and_a_lost_experiment_is_noticed() {
    let mut both = Both::new(&Protocol::Jnd(JndProtocol::default()), 1);
    let before = both.prompt.screen().cloned();
    both.teller.send(WindowMessage::Warning { warning: Warning::OutOfRange }).unwrap();
    assert!(both.prompt.poll() && both.prompt.is_warned());
    both.prompt.key(StudyKey::Enter);
    assert_eq!(both.hears.try_recv(), Ok(WindowReply::Input(Input::Continue)));
    both.teller.send(WindowMessage::Refused { refused: "not now".to_owned() }).unwrap();
    both.prompt.poll();
    assert_eq!((both.prompt.refused(), both.prompt.is_persons_turn()), (Some("not now"), true));
    assert_eq!(both.prompt.screen().cloned(), before);
    drop(both.teller);
    both.prompt.poll();
    assert!(both.prompt.is_lost());
}
