//! A person in front of an experiment: every screen, by keyboard alone.

use super::window::{recorded, until, until_fresh, window};
use crate::support::{FakeHost, PATIENCE};
use egui::accesskit::Role;
use egui::{Key, Pos2, Rect, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use flotor_core::trace::Events;
use flotor_live::Ask;
use flotor_study::protocol::{MagnitudeProtocol, Protocol, Quality, SubjectNumber};
use flotor_study::screen::{
    May, Pause, Question, Screen, ScreenStateMachine, TrialView, Warning, WindowMessage, WindowReply,
    WindowState,
};
use flotor_study::sitting::Sitting;
use flotor_study::trial::{Phase, Position};
use flotor_viewer::app::{RunSelection, Start, Viewer};
use flotor_viewer::experiment::Prompt;
use flotor_viewer::experiment::texts::Texts;
use flotor_viewer::palette::Look;
use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

/// A sitting in front of the window, subject 2: haptics alone first, then with vision. Everything by keyboard; nothing is to be
/// seen of the spring unless it may be.
#[test]
fn a_person_is_led_through_trials_by_keyboard_and_sees_nothing_in_the_haptics_alone_condition() {
    const VIEW: &str = "3D view; drag turns it, the wheel zooms";
    let magnitude = MagnitudeProtocol {
        demo: 1,
        replications: 1,
        values: vec![12.0, 30.0, 48.0],
        ..MagnitudeProtocol::default()
    };
    let protocol = Protocol::Magnitude(magnitude);
    let sitting = Sitting::new(&protocol, 1, SubjectNumber::new(2).expect("a legal number"));
    let mut experiment = ScreenStateMachine::new(sitting, &protocol, 0);
    let ((teller, told), (said, hears)) = (channel(), channel());
    let prompt = Box::new(Prompt::new(told, said));
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut host = FakeHost::new(&folder, &[]);
    let start =
        |directory: &flotor_live::Directory| Start::Sitting(RunSelection::newest(directory.clone()), prompt);
    let mut window = host.welcome(|directory| window(start(directory)));
    assert_eq!(hears.recv_timeout(PATIENCE), Ok(WindowReply::Window { window: WindowState::Open }));
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(100, Events::NONE);
    until(&mut window, |window| !window.state().history().is_empty());

    let (mut headlines, mut seen) = (Vec::new(), 0);
    while !experiment.is_over() {
        let screen = experiment.screen();
        teller.send(WindowMessage::Screen(screen.clone())).expect("the window listens");
        until(&mut window, |window| window.state().prompt().is_some_and(Prompt::is_persons_turn));
        window.run_steps(1);
        let is_seen = matches!(&screen, Screen::Feel { trial, .. } if trial.object_is_shown);
        assert_eq!(window.query_by_role_and_label(Role::Image, VIEW).is_some(), is_seen, "{screen:?}");
        seen += u32::from(is_seen);
        window.get_by_label("EMERGENCY STOP");
        assert!(window.query_by_label_contains("spring 0.1.0").is_none(), "no names of plugins");
        assert!(window.query_by_label("Parameters (P)").is_none());
        assert!(window.query_by_label("Light (L)").is_none(), "no controls but the stop");
        let headline = match &screen {
            Screen::Ready { reason: Pause::Welcome, .. } => "How stiff is the spring?",
            Screen::Ready { next, .. } if next.phase == Phase::Main => "From now on it counts",
            Screen::Ready { .. } => "A few to get used to it",
            Screen::Feel { .. } => "Feel the spring",
            Screen::Ask { .. } => "How stiff was it?",
            Screen::Over | Screen::Read { .. } => unreachable!("it ends the loop"),
        };
        window.get_by_label(headline);
        headlines.push(headline);
        if !is_seen {
            // A window of words leaves the processor to the loop: ticks that come do not make 60 pictures a second of them.
            host.run_ticks(20, Events::NONE);
            window.run_steps(1);
            let delay = window.output().viewport_output.values().map(|output| output.repaint_delay).min();
            assert!(delay.is_some_and(|delay| delay >= Duration::from_millis(100)), "{delay:?}");
        }
        if headline == "How stiff was it?" {
            window.key_press(Key::Num7);
            window.run_steps(1);
            window.get_by_label("7");
        }
        window.key_press(Key::Enter);
        window.run_steps(1);
        let Ok(WindowReply::Input(input)) = hears.recv_timeout(PATIENCE) else { panic!("nothing is said") };
        assert!(experiment.input(input, 1.0).is_ok());
    }
    let times = |what: &str| headlines.iter().filter(|headline| **headline == what).count();
    assert_eq!((times("Feel the spring"), times("How stiff was it?"), seen), (8, 8, 4));

    teller.send(WindowMessage::Warning { warning: Warning::OutOfRange }).expect("the window listens");
    until(&mut window, |window| window.query_by_label_contains("out of its range").is_some());
    host.end("the device has stopped");
    until(&mut window, |window| window.query_by_label("The device has stopped").is_some());
    teller.send(WindowMessage::Screen(Screen::Over)).expect("the window listens");
    until(&mut window, |window| window.query_by_label("Thank you").is_some());
}

fn trial(quality: Quality, stimuli: usize, object_is_shown: bool) -> TrialView {
    let (number, of_about, phase, repeat, may) = (3, 12, Phase::Main, 0, Vec::new());
    TrialView { number, of_about, phase, object_is_shown, repeat, stimuli, quality, may }
}

/// Text is a share of the height, with its keys beside it, from a laptop to a display of 3840 x 2160 at any scale.
#[test]
fn the_text_of_a_screen_grows_with_its_height_and_has_its_keys_beside_it() {
    let ((teller, told), (said, _hears)) = (channel(), channel());
    let mut prompt = Prompt::new(told, said);
    prompt.texts =
        Texts::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/texts/german.toml"))).expect("texts");
    let question = Question::WhichIsMore;
    let screen = Screen::Ask { trial: trial(Quality::Stiffness, 2, false), question };
    teller.send(WindowMessage::Screen(screen)).expect("the window listens");
    let mut window = window(recorded(100, None));
    window.state_mut().rehearse(prompt);
    for size in [[800.0, 600.0], [1280.0, 800.0], [1920.0, 1080.0], [3840.0, 2160.0], [1920.0, 1080.0]] {
        let height = size[1];
        window.set_size(Vec2::from(size));
        window.run_steps(3);
        let question = window.get_by_label("Welche war steifer?").rect();
        let keys = window.get_by_label_contains("2  die zweite").rect();
        assert!(question.height() > 0.05 * height, "{size:?}: {question:?}");
        assert!(keys.height() > 0.025 * height, "{size:?}: {keys:?}");
        assert!(
            keys.top() > question.bottom() && keys.top() - question.bottom() < 0.1 * height,
            "{size:?}: {keys:?}"
        );
        assert!(window.get_by_label("3 von etwa 12").rect().height() > 0.02 * height);
        let stop = window.get_by_label("NOT-HALT").rect();
        assert!(stop.height() > 0.03 * height, "{size:?}: {stop:?}");
    }
}

/// All of a text is in sight where there is room, with the key that goes on beneath it.
#[test]
fn a_text_to_be_read_is_shown_to_its_end() {
    let ((teller, told), (said, _hears)) = (channel(), channel());
    let text =
        "Consent\n\nYou take part.\n\nYou may stop at any time.\n\nNobody else sees your answers.".to_owned();
    teller.send(WindowMessage::Screen(Screen::Read { text })).expect("the window listens");
    let mut window = window(recorded(100, None));
    window.state_mut().rehearse(Prompt::new(told, said));
    window.run_steps(3);
    let [text, key] = ["Nobody else sees your answers.", "Enter to go on"]
        .map(|label| window.get_by_label_contains(label).rect());
    let line = window.get_by_label("Consent").rect().height();
    assert!(text.height() > 3.0 * line, "{text:?} has seven lines");
    assert!(key.top() >= text.bottom() && key.bottom() < 800.0, "{text:?}, {key:?}");
}

/// Every screen there is: its headline and the keys that mean something, in sight, apart from each other, in a small window too.
#[test]
fn every_screen_of_a_sitting_says_what_to_do_and_which_keys_do_it() {
    use Quality::{Force, Stiffness};
    let ready = |reason, next| Screen::Ready { reason, next };
    let feel = |position, trial| Screen::Feel { trial, position };
    let ask_with = |left, question, trial| {
        let may = vec![May::Again { left }];
        Screen::Ask { trial: TrialView { may, ..trial }, question }
    };
    let ask = |question, trial| ask_with(None, question, trial);
    let [one, two] = [1, 2].map(|stimuli| trial(Stiffness, stimuli, false));
    let [strong, stronger] = [1, 2].map(|stimuli| trial(Force, stimuli, false));
    let seen = trial(Stiffness, 1, true);
    let practice = TrialView { phase: Phase::Practice, ..one.clone() };
    let screens = [
        (ready(Pause::Welcome, one.clone()), "How stiff is the spring?", "Enter to begin"),
        (ready(Pause::Welcome, two.clone()), "Which spring is stiffer?", "Enter to begin"),
        (ready(Pause::Welcome, strong.clone()), "How strong is the force?", "Enter to begin"),
        (ready(Pause::Welcome, stronger.clone()), "Which force is stronger?", "Enter to begin"),
        (ready(Pause::PhaseChanges, practice.clone()), "A few to get used to it", "Enter to go on"),
        (ready(Pause::PhaseChanges, one.clone()), "From now on it counts", "Enter to go on"),
        (ready(Pause::ModalityChanges, seen.clone()), "From now on you see what you feel", "Enter to go on"),
        (ready(Pause::ModalityChanges, one.clone()), "From now on you feel only", "Enter to go on"),
        (ready(Pause::Rest, one.clone()), "Time for a rest", "Enter to go on"),
        (ready(Pause::OutOfRange, one.clone()), "Once more", "Enter to go on"),
        (feel(None, practice.clone()), "Feel the spring", "Enter when you have felt it"),
        (feel(None, seen), "Feel the spring", "Enter when you have felt it"),
        (feel(None, strong.clone()), "Feel the force", "Enter when you have felt it"),
        (feel(Some(Position::First), two.clone()), "First spring", "Enter when you have felt it"),
        (feel(Some(Position::Second), two.clone()), "Second spring", "Enter when you have felt it"),
        (feel(Some(Position::First), stronger.clone()), "First force", "Enter when you have felt it"),
        (
            feel(Some(Position::First), TrialView { may: vec![May::Withdraw], ..two.clone() }),
            "First spring",
            "U  take the last answer back",
        ),
        (ask(Question::HowMuch, practice), "How stiff was it?", "A  feel it again"),
        (ask(Question::HowMuch, one), "How stiff was it?", "Backspace corrects"),
        (ask(Question::HowMuch, strong), "How strong was it?", "Enter when it is right"),
        (
            ask_with(Some(12), Question::WhichIsMore, two.clone()),
            "Which one was stiffer?",
            "A  feel them again, 12 times more",
        ),
        (ask(Question::WhichIsMore, two), "Which one was stiffer?", "0  I don't know"),
        (ask(Question::WhichIsMore, stronger), "Which one was stronger?", "1  the first"),
        (Screen::Over, "Thank you", "Enter closes the window"),
    ];
    let ((teller, told), (said, _hears)) = (channel(), channel());
    let prompt = Box::new(Prompt::new(told, said));
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut host = FakeHost::new(&folder, &[]);
    let size = vec2(800.0, 600.0);
    let mut window = host.welcome(|directory| {
        let start = Start::Sitting(RunSelection::newest(directory.clone()), prompt);
        let harness = Harness::builder().with_size(size).with_step_dt(1.0 / 60.0);
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Light))
    });
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(100, Events::NONE);
    for (screen, headline, keys) in screens {
        teller.send(WindowMessage::Screen(screen.clone())).expect("the window listens");
        until_fresh(&mut window, &mut host, |window| {
            window.query_by_label(headline).is_some() && window.query_by_label_contains(keys).is_some()
        });
        let [headline, keys] =
            [window.get_by_label(headline).rect(), window.get_by_label_contains(keys).rect()];
        let all = Rect::from_min_size(Pos2::ZERO, size);
        assert!(all.contains_rect(headline) && all.contains_rect(keys), "{screen:?}: {headline:?}, {keys:?}");
        assert!(headline.bottom() < keys.top(), "{screen:?}: {headline:?}, {keys:?}");
    }
}
