//! Every panel and screen by its accessibility tree, without display or GPU: what a person can find, press and pull, and
//! what comes of it at the host.

mod support;

use egui::accesskit::Role;
use egui::{Key, Pos2, Rect, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use flotor_live::{Ask, Outcome};
use flotor_record::trace::Events;
use flotor_study::protocol::{MagnitudeProtocol, Protocol, Quality, SubjectNumber};
use flotor_study::screen::{Attended, Pause, Question, Said, Screen, Told, TrialView, Warning, WindowState};
use flotor_study::sitting::Sitting;
use flotor_study::trial::{Phase, Position};
use flotor_viewer::app::{Start, Viewer, Wanted};
use flotor_viewer::experiment::Prompt;
use flotor_viewer::history::{History, Keep};
use flotor_viewer::palette::Look;
use flotor_viewer::panel::{Standing, Value};
use flotor_viewer::player::Motion;
use flotor_viewer::ui::plot_stack::ExportFormat;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};
use support::{FakeHost, PATIENCE, plugin_file, spring_run, tick};

type Window<'a> = Harness<'a, Viewer>;

fn window<'a>(start: Start) -> Window<'a> {
    let harness = Harness::builder().with_size(vec2(1280.0, 800.0)).with_step_dt(1.0 / 60.0);
    harness.build_eframe(|creation| {
        let device = creation.wgpu_render_state.clone();
        Viewer::new(&creation.egui_ctx, device.as_ref(), start, Look::Dark)
    })
}

fn recording<'a>() -> Window<'a> {
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::All);
    (0..3000).for_each(|number| history.push(&tick(number, Events::NONE)));
    let mut window = window(Start::Recording(Box::new(history), Some(0.5), vec![plugin_file("spring")]));
    window.run_steps(3);
    window
}

/// A window on a fake host that has run for a while.
fn live<'a>(settings: &[(&str, &str)]) -> (Window<'a>, FakeHost, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut host = FakeHost::new(&folder, settings);
    let mut window = host.welcome(|directory| window(Start::Live(Wanted::newest(directory.clone()))));
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(1500, Events::NONE);
    until(&mut window, |window| window.state().history().len() >= 1500);
    window.run_steps(2);
    (window, host, folder)
}

/// Makes pictures until something is true.
fn until(window: &mut Window<'_>, mut is_true: impl FnMut(&Window<'_>) -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_true(window) {
        assert!(Instant::now() < end, "it does not happen");
        std::thread::sleep(Duration::from_millis(5));
        window.run_steps(1);
    }
}

/// The same while ticks come: on a machine with other things to do a second may pass between two pictures, and what is shown is then
/// rightly called old.
fn until_fresh(window: &mut Window<'_>, host: &mut FakeHost, is_true: impl Fn(&Window<'_>) -> bool) {
    until(window, |window| {
        let is_true = is_true(window);
        if !is_true {
            host.run_ticks(1, Events::NONE);
        }
        is_true
    });
}

fn number_of(window: &Window<'_>, parameter: &str) -> f64 {
    let panel = &window.state().panels()[1];
    let knob = panel.knobs.iter().find(|knob| knob.parameter.id == parameter).expect("the spring has it");
    match knob.value {
        Value::Number(number) => number,
        ref other => panic!("{other:?}"),
    }
}

#[test]
fn without_a_run_the_window_says_what_to_do() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut window = window(Start::Live(Wanted::newest(flotor_live::Directory::at(folder.path()))));
    window.run_steps(2);
    window.get_by_label("Waiting for a run");
    assert!(window.query_by_label("EMERGENCY STOP").is_none(), "there is nothing to stop");
}

#[test]
fn a_slider_reaches_the_host_and_follows_what_the_loop_says() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    window.get_by_role_and_label(Role::Slider, "gamma").set_value_accesskit(30.0);
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    assert_eq!((values[0].plugin.as_str(), values[0].parameter.as_str()), ("spring", "gamma_n"));
    assert_eq!(values[0].value, "30");
    let before = number_of(&window, "alpha_n_mm2");
    host.changed(&values[0], Outcome::Applied);
    until(&mut window, |window| (number_of(window, "alpha_n_mm2") - before).abs() > 1.0);
    assert_eq!(number_of(&window, "gamma_n"), 30.0);
}

#[test]
fn a_refused_change_goes_back_and_says_why() {
    let (mut window, mut host, _folder) = live(&[]);
    window.get_by_role_and_label(Role::Slider, "gamma").set_value_accesskit(25.0);
    window.run_steps(2);
    let Ask::Set { values } = host.request(Some("the loop is busy")) else {
        panic!("something else was asked")
    };
    until(&mut window, |window| window.query_by_label_contains("the loop is busy").is_some());
    host.changed(&values[0], Outcome::Refused);
    until(&mut window, |window| window.query_by_label_contains("does not fit").is_some());
    assert!((number_of(&window, "gamma_n") - 25.0).abs() > 1.0, "the old value is in force and shown");
}

/// As in the thesis: the physical panel drives the rigidity panel, and not the other way round.
#[test]
fn physical_parameters_drive_the_rigidities_and_not_the_other_way_round() {
    let (mut window, mut host, _folder) = live(&[("mode", "physical")]);
    let standing = |window: &Window<'_>, id: &str| {
        let knobs = &window.state().panels()[1].knobs;
        knobs.iter().find(|knob| knob.parameter.id == id).expect("the spring has it").standing.clone()
    };
    assert_eq!(standing(&window, "wire_diameter_mm"), Standing::Free);
    assert!(matches!(standing(&window, "gamma_n"), Standing::Follows(_)));
    window.get_by_label("Follow from these");
    assert!(window.get_by_role_and_label(Role::Slider, "gamma").accesskit_node().is_disabled());
    let before = number_of(&window, "gamma_n");
    window.get_by_role_and_label(Role::Slider, "wire diameter").set_value_accesskit(0.8);
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    host.changed(&values[0], Outcome::Applied);
    until(&mut window, |window| number_of(window, "gamma_n") > 1.5 * before);

    let (window, _host, _folder) = live(&[("mode", "gamma")]);
    assert!(matches!(standing(&window, "wire_diameter_mm"), Standing::Follows(_)));
    assert_eq!(standing(&window, "gamma_n"), Standing::Free);
}

#[test]
fn the_emergency_stop_is_always_in_sight_and_on_the_largest_key() {
    let (mut window, mut host, _folder) = live(&[]);
    window.get_by_label("EMERGENCY STOP").click();
    window.run_steps(2);
    assert_eq!(host.request(None), Ask::EmergencyStop);
    window.key_press(Key::P);
    window.run_steps(2);
    assert!(window.query_by_role_and_label(Role::Slider, "gamma").is_none(), "P puts the panel away");
    window.get_by_label("EMERGENCY STOP");
    window.key_press(Key::Space);
    window.run_steps(2);
    assert_eq!(host.request(None), Ask::EmergencyStop);
    host.end("emergency stop (a program that watches); the device is stopped");
    until(&mut window, |window| window.query_by_label_contains("emergency stop (").is_some());
    assert!(window.query_by_label("EMERGENCY STOP").is_none());
    assert!(window.state().panels()[1].knobs.iter().all(|knob| knob.standing == Standing::Fixed));
}

#[test]
fn warnings_say_what_and_what_to_do_and_stay_in_sight_a_while() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label_contains("⚠").is_none());
    host.run_ticks(1, Events::FORCE_LIMITED);
    host.run_ticks(300, Events::NONE);
    until(&mut window, |window| window.query_by_label_contains("Excess force").is_some());
    window.get_by_label_contains("ease off");
    host.run_ticks(1500, Events::NONE);
    until(&mut window, |window| window.query_by_label_contains("Excess force").is_none());
    window.get_by_label("force limited"); // counted
    window.get_by_label("1 ticks");
    // Nothing comes any more, and the host has not said that it ended.
    std::thread::sleep(Duration::from_millis(600));
    window.run_steps(2);
    window.get_by_label("no ticks come");
    window.get_by_label_contains("Stale data");
}

#[test]
fn the_view_turns_zooms_and_comes_back() {
    let mut window = recording();
    let start = window.state().view().camera;
    let area = window.get_by_role_and_label(Role::Image, "3D view; drag turns it, the wheel zooms").rect();
    window.hover_at(area.center());
    window.drag_at(area.center());
    window.run_steps(1);
    window.hover_at(area.center() + vec2(60.0, 20.0));
    window.run_steps(1);
    window.drop_at(area.center() + vec2(60.0, 20.0));
    window.run_steps(1);
    let turned = window.state().view().camera;
    assert!((turned.azimuth_rad - start.azimuth_rad).abs() > 0.1, "the mouse turns it");
    assert!(turned.inclination_rad > start.inclination_rad);
    window.key_press(Key::Minus);
    window.run_steps(1);
    assert!(window.state().view().camera.distance_mm > turned.distance_mm);
    window.key_press(Key::R);
    window.run_steps(1);
    assert_eq!(window.state().view().camera, start, "the experimenter's view");
}

#[test]
fn a_recording_is_played_scrubbed_and_repeated() {
    let mut window = recording();
    window.get_by_label("recording");
    assert_eq!(window.state().player().now_s, 0.5);
    window.key_press(Key::Space);
    window.run_steps(30);
    let now_s = window.state().player().now_s;
    assert!(now_s > 0.7 && now_s < 1.3, "half a second later: {now_s}");
    window.get_by_label("Pause").click();
    window.run_steps(2);
    assert_eq!(window.state().player().motion, Motion::Pause);
    window.get_by_role_and_label(Role::Slider, "Time").set_value_accesskit(2.0);
    window.run_steps(2);
    assert!((window.state().player().now_s - 2.0).abs() < 1.0e-9);
    window.key_press(Key::ArrowLeft);
    window.run_steps(1);
    assert!((window.state().player().now_s - 1.0).abs() < 1.0e-9);
    window.key_press(Key::End);
    window.key_press(Key::Space);
    window.run_steps(2);
    assert!(window.state().player().now_s < 0.5, "from the beginning");
    window.get_by_label("loop").click();
    window.run_steps(1);
    assert!(!window.state().player().repeats);
}

#[test]
fn traces_are_chosen_switched_and_written_to_files() {
    let mut window = recording();
    window.get_by_label("Force over time, N");
    window.get_by_role_and_label(Role::Button, "Energy").click();
    window.run_steps(2);
    window.get_by_label("Energy over time, mJ");
    window.key_press(Key::U);
    window.run_steps(2);
    window.get_by_label("Energy over time, J");
    window.get_by_label("Position over time, m");

    let folder = tempfile::tempdir().expect("a scratch folder");
    for (format, starts) in [
        (ExportFormat::Csv, b"time_s,Force Fx (N)".as_slice()),
        (ExportFormat::Svg, b"<svg".as_slice()),
        (ExportFormat::Png, b"\x89PNG".as_slice()),
    ] {
        let path = folder.path().join("traces");
        let viewer = window.state();
        flotor_viewer::export::write(viewer.history(), viewer.plots(), format, Look::Light, &path)
            .expect("written");
        let written = std::fs::read(&path).expect("it is there");
        assert!(written.starts_with(starts), "{:?}", String::from_utf8_lossy(&written[..20]));
        if format == ExportFormat::Csv {
            assert_eq!(
                written.iter().filter(|byte| **byte == b'\n').count(),
                3001,
                "every sample and the names"
            );
        }
    }
}

#[test]
fn the_look_is_switched_and_everything_stays_where_it_was() {
    let mut window = recording();
    window.get_by_label("Light (L)").click();
    window.run_steps(2);
    assert_eq!(window.state().look(), Look::Light);
    window.get_by_label("Dark (L)");
    window.key_press(Key::L);
    window.run_steps(2);
    assert_eq!(window.state().look(), Look::Dark);
}

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
    let mut experiment = Attended::new(sitting, &protocol, 1, 0);
    let ((teller, told), (said, hears)) = (channel(), channel());
    let prompt = Box::new(Prompt::new(told, said));
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut host = FakeHost::new(&folder, &[]);
    let start =
        |directory: &flotor_live::Directory| Start::Sitting(Wanted::newest(directory.clone()), prompt);
    let mut window = host.welcome(|directory| window(start(directory)));
    assert_eq!(hears.recv_timeout(PATIENCE), Ok(Said::Window { window: WindowState::Open }));
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(100, Events::NONE);

    let (mut headlines, mut seen) = (Vec::new(), 0);
    while !experiment.is_over() {
        let screen = experiment.screen();
        teller.send(Told::Screen(screen.clone())).expect("the window listens");
        until(&mut window, |window| window.state().prompt().is_some_and(Prompt::is_persons_turn));
        window.run_steps(1);
        let is_seen = matches!(&screen, Screen::Feel { trial, .. } if trial.object_is_shown);
        assert_eq!(window.query_by_role_and_label(Role::Image, VIEW).is_some(), is_seen, "{screen:?}");
        seen += u32::from(is_seen);
        window.get_by_label("EMERGENCY STOP");
        assert!(window.query_by_label_contains("spring 0.1.0").is_none(), "no names of plugins");
        assert!(window.query_by_label("Parameters (P)").is_none());
        let headline = match &screen {
            Screen::Ready { reason: Pause::Welcome, .. } => "How stiff is the spring?",
            Screen::Ready { next, .. } if next.phase == Phase::Main => "From now on it counts",
            Screen::Ready { .. } => "A few to get used to it",
            Screen::Feel { .. } => "Feel the spring",
            Screen::Ask { question: Question::Nothing, .. } => "That was one to practise",
            Screen::Ask { .. } => "How stiff was it?",
            Screen::Over => unreachable!("it ends the loop"),
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
        let Ok(Said::Input(input)) = hears.recv_timeout(PATIENCE) else { panic!("nothing is said") };
        assert!(experiment.input(input, 1.0).is_ok());
    }
    let times = |what: &str| headlines.iter().filter(|headline| **headline == what).count();
    assert_eq!((times("Feel the spring"), times("How stiff was it?"), seen), (8, 6, 4));

    teller.send(Told::Warning { warning: Warning::OutOfRange }).expect("the window listens");
    until(&mut window, |window| window.query_by_label_contains("out of its range").is_some());
    host.end("the device has stopped");
    until(&mut window, |window| window.query_by_label("The device has stopped").is_some());
    teller.send(Told::Screen(Screen::Over)).expect("the window listens");
    until(&mut window, |window| window.query_by_label("Thank you").is_some());
}

fn trial(quality: Quality, stimuli: usize, object_is_shown: bool) -> TrialView {
    TrialView {
        number: 3,
        of_about: 12,
        phase: Phase::Main,
        object_is_shown,
        condition: "K".to_owned(),
        repeat: 0,
        stimuli,
        quality,
    }
}

/// Every screen there is: its headline and the keys that mean something, in sight, apart from each other, in a small window too.
#[test]
fn every_screen_of_a_sitting_says_what_to_do_and_which_keys_do_it() {
    use Quality::{Force, Stiffness};
    let ready = |reason, next| Screen::Ready { reason, next };
    let feel = |position, trial| Screen::Feel { trial, position };
    let ask = |question, trial| Screen::Ask { trial, question };
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
        (ask(Question::Nothing, practice), "That was one to practise", "A  feel it again"),
        (ask(Question::HowMuch, one), "How stiff was it?", "Backspace corrects"),
        (ask(Question::HowMuch, strong), "How strong was it?", "Enter when it is right"),
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
        let start = Start::Sitting(Wanted::newest(directory.clone()), prompt);
        let harness = Harness::builder().with_size(size).with_step_dt(1.0 / 60.0);
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Light))
    });
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks(100, Events::NONE);
    for (screen, headline, keys) in screens {
        teller.send(Told::Screen(screen.clone())).expect("the window listens");
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

#[test]
fn limits_say_how_much_of_them_is_used() {
    let (mut window, mut host, _folder) = live(&[]);
    // 30 N and 1 N·m at the host; the spring of the ticks that are sent has 0.7 N/mm and is 4 mm short after half a second.
    host.run_ticks(1001, Events::NONE);
    until_fresh(&mut window, &mut host, |window| {
        window.query_by_role_and_label(Role::ProgressIndicator, "Fz +2.8 of 30 N").is_some()
    });
    window.get_by_role_and_label(Role::ProgressIndicator, "Mx +0.0 of 1000 mN·m");
}

#[test]
fn traces_can_be_written_in_three_formats() {
    let mut window = recording();
    window.get_by_label("Export").click();
    window.run_steps(2);
    for format in ["CSV", "SVG", "PNG"] {
        window.get_by_role_and_label(Role::Button, format);
    }
}

/// Text twice as large: everything is still there.
#[test]
fn twice_the_scale_loses_nothing() {
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::All);
    (0..1000).for_each(|number| history.push(&tick(number, Events::NONE)));
    let harness = Harness::builder().with_size(vec2(960.0, 600.0)).with_pixels_per_point(2.0);
    let start = Start::Recording(Box::new(history), None, vec![plugin_file("spring")]);
    let mut window =
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Light));
    window.run_steps(3);
    for label in ["A spring under test", "Force over time, N", "Position over time, mm", "Play"] {
        let area = window.get_by_label(label).rect();
        assert!(area.max.x <= 960.5 && area.max.y <= 600.5 && area.width() > 8.0, "{label}: {area:?}");
    }
}

/// From 100 to 200 %, in windows from a small laptop's to a large screen's: everything that can be pressed or read lies inside, and
/// nothing is cut off at the right of the side.
#[test]
fn every_scale_and_size_keeps_everything_in_sight() {
    for (scale, size) in
        [(1.0, [1280.0, 800.0]), (1.25, [1024.0, 640.0]), (1.5, [853.0, 533.0]), (2.0, [960.0, 600.0])]
    {
        let (run, _) = spring_run(&[]);
        let mut history = History::new(run, Keep::All);
        (0..1000).for_each(|number| history.push(&tick(number, Events::NONE)));
        let harness = Harness::builder().with_size(egui::Vec2::from(size)).with_pixels_per_point(scale);
        let start = Start::Recording(Box::new(history), None, vec![plugin_file("spring")]);
        let mut window =
            harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Dark));
        window.run_steps(3);
        let labels = [
            "A spring under test",
            "Force over time, N",
            "Position over time, mm",
            "Play",
            "Export",
            "Light (L)",
        ];
        for label in labels {
            let area = window.get_by_label(label).rect();
            let is_inside = area.min.x >= 0.0 && area.max.x <= size[0] + 0.5 && area.max.y <= size[1] + 0.5;
            assert!(is_inside && area.width() > 8.0, "{label} at {scale} in {size:?}: {area:?}");
        }
    }
}

/// What was chosen is there the next time: look, units, traces, the panel.
#[test]
fn a_window_is_as_it_was_left() {
    let mut left = recording();
    left.key_press(Key::L);
    left.key_press(Key::U);
    left.run_steps(1);
    left.get_by_label("Energy").click();
    left.key_press(Key::P);
    left.run_steps(3);
    let remembered = left.state().remembered();
    let mut next = recording();
    assert_ne!(next.state().remembered(), remembered);
    let context = next.ctx.clone();
    next.state_mut().recall(&context, &remembered);
    next.run_steps(3);
    assert_eq!(next.state().remembered(), remembered);
    next.get_by_label("Dark (L)");
    next.get_by_label("Energy over time, J");
    assert!(next.query_by_label("preset").is_none(), "the panel was put away");
}

/// What has not changed is not made again: while the mouse moves, no sample is looked at and no corner of a triangle is made;
/// a tick that comes is looked at once for each trace; a handle that rests costs no corner, whatever the time.
#[test]
fn a_picture_makes_what_is_new_and_nothing_else() {
    let work = |window: &Window<'_>| {
        let viewer = window.state();
        (viewer.plots().visited(), viewer.view().corners_made())
    };
    let mut window = recording();
    let before = work(&window);
    let area = window.get_by_label("Force over time, N").rect();
    for step in 0..20_u8 {
        window.hover_at(area.center() + vec2(4.0 * f32::from(step), 0.0));
        window.run_steps(1);
    }
    assert_eq!(work(&window), before, "a cursor that moves over a recording");
    window.key_press(Key::D);
    window.run_steps(2);
    let (visited, corners) = work(&window);
    assert!(visited == before.0 && corners > before.1, "a view that turns");

    let (mut window, mut host, _folder) = live(&[]);
    let traces = window.state().plots().shown.len() as u64;
    for new in [16, 1, 33] {
        let (visited, _) = work(&window);
        let last = window.state().history().len() + usize::try_from(new).expect("a few");
        host.run_ticks(new, Events::NONE);
        until(&mut window, |window| window.state().history().len() == last);
        window.run_steps(5);
        assert_eq!(work(&window).0, visited + traces * new, "{new} ticks");
    }

    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::All);
    for number in 0..3000 {
        let mut resting = tick(number, Events::NONE);
        resting.pose = tick(250, Events::NONE).pose;
        resting.commanded = tick(250, Events::NONE).commanded;
        history.push(&resting);
    }
    let mut window =
        crate::window(Start::Recording(Box::new(history), Some(0.0), vec![plugin_file("spring")]));
    window.run_steps(3);
    let before = work(&window);
    window.key_press(Key::Space);
    window.run_steps(30);
    assert!(window.state().player().now_s > 0.3, "it plays");
    assert_eq!(work(&window), before, "a handle that rests");
}

/// A window of time that is shorter than the run has the moment shown in it, wherever that is.
#[test]
fn traces_go_where_the_moment_is() {
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::All);
    (0..30_000).for_each(|number| history.push(&tick(number, Events::NONE)));
    let mut window = window(Start::Recording(Box::new(history), Some(12.0), vec![plugin_file("spring")]));
    window.run_steps(2);
    window.get_by_label("Time shown").click();
    window.run_steps(2);
    window.get_by_label("5 s").click();
    window.run_steps(2);
    let span_s = |window: &Window<'_>| {
        let viewer = window.state();
        let [first_s, last_s] = viewer.plots().span_s(viewer.history());
        assert!((last_s - first_s - 5.0).abs() < 1.0e-9);
        assert!((first_s..=last_s).contains(&viewer.player().now_s), "{first_s} to {last_s}");
        [first_s, last_s]
    };
    span_s(&window);
    let keys = [
        (Key::ArrowRight, false),
        (Key::ArrowRight, false),
        (Key::ArrowLeft, false),
        (Key::Home, true),
        (Key::ArrowRight, false),
        (Key::End, true),
        (Key::ArrowLeft, false),
    ];
    for (key, moves) in keys {
        let before = span_s(&window);
        window.key_press(key);
        window.run_steps(2);
        assert_eq!(span_s(&window) != before, moves, "{key:?} from {before:?}");
    }
}

/// A window that nobody touches makes no pictures: what costs nothing costs no processor.
#[test]
fn a_recording_that_stands_still_asks_for_no_more_pictures() {
    let mut window = recording();
    window.run_steps(10);
    let delay = window.output().viewport_output.values().map(|viewport| viewport.repaint_delay).min();
    assert!(delay.is_none_or(|delay| delay > Duration::from_secs(60)), "{delay:?}");
}

/// The window itself under a stream: pictures are made while ticks come, an hour's worth at full size, half a minute's at quick, and
/// memory stays. What waits for a picture is bounded, so a window that makes none loses ticks and not memory.
#[test]
fn a_window_that_streams_does_not_grow() {
    let seconds = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 3600 } else { 30 };
    const STEP_S: u64 = 5;
    let (mut window, mut host, _folder) = live(&[]);
    let (mut before, mut sent) = (0, 1500);
    // The history holds a minute, and is filled first.
    for step in 0..(60 + seconds) / STEP_S {
        host.run_ticks(1000 * STEP_S, Events::NONE);
        sent += 1000 * STEP_S;
        until(&mut window, |window| {
            window.state().history().at(f64::INFINITY).is_some_and(|sample| sample.tick + 1 >= sent)
        });
        if step == 60 / STEP_S {
            before = resident_kib();
        }
    }
    assert_eq!(window.state().history().len(), 60_000);
    let grown = resident_kib().saturating_sub(before);
    assert!(
        grown < 32 * 1024,
        "{grown} KiB more after {seconds} s; other tests of this program allocate, too"
    );
}

/// An hour of a running host at full size, two minutes at quick: the history holds a minute, and memory stays.
#[test]
fn streaming_is_bounded() {
    let minutes = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 60 } else { 2 };
    let (run, _) = spring_run(&[]);
    let mut history = History::new(run, Keep::Newest(60_000));
    let feed = |history: &mut History, from: u64, count: u64| {
        (from..from + count).for_each(|number| history.push(&tick(number, Events::NONE)));
    };
    feed(&mut history, 0, 70_000);
    let before = resident_kib();
    feed(&mut history, 70_000, minutes * 60_000);
    assert_eq!(history.len(), 60_000);
    let grown = resident_kib().saturating_sub(before);
    assert!(
        grown < 32 * 1024,
        "{grown} KiB more after {minutes} minutes; other tests of this program allocate, too"
    );
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has a size");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number of KiB")
}
