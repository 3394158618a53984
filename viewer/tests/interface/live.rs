//! A running host: how it stands, what warns, what stops it, and its parameters: what is pulled reaches the host, and what the
//! loop took is what is shown.

use super::texts::texts;
use super::window::{Window, live, until, until_fresh, window};
use crate::support::FakeHost;
use egui::Key;
use egui::accesskit::Role;
use egui_kittest::kittest::{NodeT, Queryable};
use flotor_core::trace::Events;
use flotor_live::{Ask, Outcome};
use flotor_viewer::app::{RunSelection, Start};
use flotor_viewer::panel::{Editability, Value};

#[test]
fn without_a_run_the_window_says_what_to_do() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut window = window(Start::Live(RunSelection::newest(flotor_live::Directory::at(folder.path()))));
    window.run_steps(2);
    window.get_by_label("Waiting for a run");
    assert!(window.query_by_label("EMERGENCY STOP").is_none(), "there is nothing to stop");
    assert!(window.query_by_label_contains("Hz").is_none(), "no run has a rate");
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
    host.end("emergency stop (the viewer's window or another client); the device is stopped");
    until(&mut window, |window| window.query_by_label_contains("emergency stop (").is_some());
    assert!(window.query_by_label("EMERGENCY STOP").is_none());
    assert!(window.state().panels()[1].entries.iter().all(|entry| entry.editability == Editability::Fixed));
}

#[test]
fn warnings_say_what_and_what_to_do_and_stay_in_sight_a_while() {
    let (mut window, mut host, _folder) = live(&[]);
    // Where pictures come late, data may rightly be called stale meanwhile.
    assert!(window.query_by_label_contains("Excess force").is_none());
    host.run_ticks(1, Events::FORCE_LIMITED);
    host.run_ticks(300, Events::NONE);
    until(&mut window, |window| window.query_by_label_contains("Excess force").is_some());
    window.get_by_label_contains("push less");
    host.run_ticks(1500, Events::NONE);
    until(&mut window, |window| window.query_by_label_contains("Excess force").is_none());
    window.get_by_label("force limited"); // counted
    window.get_by_label("1 ticks");
    // Nothing comes any more, and the host has not said that it ended.
    until(&mut window, |window| window.query_by_label("no ticks come").is_some());
    window.get_by_label_contains("Stale data");
}

/// The ticks of the host carry the times of a loop of 1 kHz, however late they come.
#[test]
fn the_rates_of_the_loop_and_of_the_pictures_are_numbers_of_a_running_session() {
    let has =
        |window: &Window<'_>, wanted: &str| texts(window.output()).iter().any(|text| text.words == wanted);
    let (mut window, mut host, _folder) = live(&[]);
    host.run_ticks(1, Events::NONE);
    until_fresh(&mut window, &mut host, |window| has(window, "Haptics"));
    assert!(has(&window, "Graphics") && has(&window, "1000.0"));
    host.end("the duration is over");
    until(&mut window, |window| !has(window, "Haptics") && !has(window, "Graphics"));
}

/// A slider that goes down under the pointer leaves it on another one.
#[test]
fn nothing_that_happens_moves_a_slider() {
    let (mut window, mut host, _folder) = live(&[]);
    host.run_ticks(10, Events::NONE);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let place = |window: &Window<'_>| window.get_by_role_and_label(Role::Slider, "gamma").rect();
    let before = place(&window);
    for (events, name) in
        [(Events::FORCE_LIMITED, "force limited"), (Events::TORQUE_LIMITED, "torque limited")]
    {
        host.run_ticks(10, events);
        until(&mut window, |window| window.query_by_label(name).is_some());
        assert_eq!(place(&window), before, "{name}");
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

/// A body that grows is none whose view was turned; the way back to the first view shows all of it.
#[test]
fn a_body_that_grows_brings_up_no_reset_of_the_view() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let before = window.state().view().camera;
    let value = |text: &str| flotor_live::SetValue {
        plugin: "spring".to_owned(),
        parameter: "free_length_mm".to_owned(),
        value: text.to_owned(),
    };
    host.changed(&value("40"), Outcome::Applied);
    until(&mut window, |window| number_of(window, "free_length_mm") == 40.0);
    window.run_steps(2);
    assert!(window.query_by_label("Reset view").is_none(), "nobody has turned it");
    window.key_press(Key::D);
    window.run_steps(2);
    window.get_by_label("Reset view").click();
    window.run_steps(2);
    assert!(window.state().view().camera.distance_mm > 1.2 * before.distance_mm);
    assert!(window.query_by_label("Reset view").is_none());
}

/// Typed key by key, `100` was 1, 10 and 100 N at the hand.
#[test]
fn a_typed_number_is_sent_when_enter_is_pressed_and_not_before() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let field = |window: &Window<'_>| window.get_by_role_and_label(Role::SpinButton, "gamma").rect();
    window.get_by_role_and_label(Role::SpinButton, "gamma").click();
    window.run_steps(2);
    for key in [Key::A, Key::Num4, Key::Num8] {
        if key == Key::A {
            window.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
        } else {
            window.event(egui::Event::Text(key.name().to_owned()));
        }
        window.run_steps(2);
    }
    host.nothing_is_asked();
    assert!(field(&window).width() > 0.0);
    window.key_press(Key::Enter);
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    assert_eq!(values[0].value, "48");
    // Half a number that is left is none.
    window.get_by_role_and_label(Role::SpinButton, "gamma").click();
    window.run_steps(2);
    window.event(egui::Event::Text("1".to_owned()));
    window.run_steps(1);
    window.get_by_label("Parameters (P)").focus();
    window.run_steps(3);
    host.nothing_is_asked();
    assert_eq!(number_of(&window, "gamma_n"), 48.0);
}

/// A slider covers the soft range, whatever is legal; what was there before comes back, and so does what the scene says.
#[test]
fn a_slider_stays_in_the_soft_range_and_what_was_there_comes_back() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let first = number_of(&window, "gamma_n");
    window.get_by_role_and_label(Role::Slider, "gamma").set_value_accesskit(10_000.0);
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    let sent: f64 = values[0].value.parse().expect("a number");
    assert!((sent - 3.0 * first).abs() < 1e-9 * first, "{sent} of {first}");
    host.changed(&values[0], Outcome::Applied);
    window.run_steps(2);
    window.get_by_label("Undo").click();
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    assert_eq!(values[0].value.parse(), Ok(first));
    window.get_by_role_and_label(Role::Slider, "gamma").set_value_accesskit(first * 1.5);
    window.run_steps(2);
    host.request(None);
    window.get_by_label("gamma as in the scene").click();
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    assert_eq!(values[0].value.parse(), Ok(first));
    window.run_steps(2);
    assert!(window.query_by_label("gamma as in the scene").is_none(), "it is as in the scene");
}

#[test]
fn a_fault_has_its_reason_in_full_and_once() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let reason = "tick 1234 exceeded the time limit, and the watchdog stopped the device; check the machine with `flotor doctor`";
    host.run_ticks(1, Events::DEVICE_FAULT);
    host.end_as(reason, flotor_live::EndKind::Failed);
    until(&mut window, |window| window.query_by_label("failed").is_some());
    window.get_by_label_contains(reason);
    assert!(window.query_by_label_contains("Device fault").is_none(), "the reason says it");
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
    let editability = |window: &Window<'_>, id: &str| {
        let entries = &window.state().panels()[1].entries;
        entries.iter().find(|entry| entry.parameter.id == id).expect("the spring has it").editability.clone()
    };
    assert_eq!(editability(&window, "wire_diameter_mm"), Editability::Free);
    assert!(matches!(editability(&window, "gamma_n"), Editability::Follows(_)));
    window.get_by_label("Computed, or without effect");
    // Under a seat that is held, friction has no effect.
    assert!(matches!(editability(&window, "seat_friction"), Editability::Follows(_)));
    assert!(window.get_by_role_and_label(Role::Slider, "gamma").accesskit_node().is_disabled());
    let before = number_of(&window, "gamma_n");
    window.get_by_role_and_label(Role::Slider, "wire diameter").set_value_accesskit(0.8);
    window.run_steps(2);
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    host.changed(&values[0], Outcome::Applied);
    until(&mut window, |window| number_of(window, "gamma_n") > 1.5 * before);

    let (window, _host, _folder) = live(&[("mode", "gamma")]);
    assert!(matches!(editability(&window, "wire_diameter_mm"), Editability::Follows(_)));
    assert_eq!(editability(&window, "gamma_n"), Editability::Free);
    let (window, _host, _folder) = live(&[("seat", "free")]);
    assert_eq!(editability(&window, "seat_friction"), Editability::Free);
}

fn number_of(window: &Window<'_>, parameter: &str) -> f64 {
    let panel = &window.state().panels()[1];
    let entry =
        panel.entries.iter().find(|entry| entry.parameter.id == parameter).expect("the spring has it");
    match entry.value {
        Value::Number(number) => number,
        ref other => panic!("{other:?}"),
    }
}

/// Random pointer events: no number leaves its soft range, and the emergency stop works throughout.
#[test]
fn no_pointer_brings_a_parameter_out_of_its_soft_range() {
    // Each event is a picture drawn on the processor.
    let events = match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => 10_000,
        Ok("daily") => 60,
        _ => return,
    };
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    let size = window.ctx.content_rect().size();
    let mut seed = 1_u32;
    let mut random = |most: f32| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 8) as f32 / (1 << 24) as f32 * most
    };
    let button = |pos, pressed| egui::Event::PointerButton {
        pos,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: egui::Modifiers::NONE,
    };
    let mut is_down = false;
    for event in 0..events {
        // A host reads; full sockets would end the connection.
        if event % 100 == 99 {
            host.all_requests();
        }
        // The right half has the panel; the emergency stop above it and the choices are left out.
        let at = egui::pos2(size.x * 0.5 + random(size.x * 0.5), 60.0 + random(size.y - 120.0));
        window.event(egui::Event::PointerMoved(at));
        if random(1.0) < 0.5 {
            is_down = !is_down;
            window.event(button(at, is_down));
        }
        if random(1.0) < 0.1 {
            let delta = egui::vec2(0.0, random(200.0) - 100.0);
            let unit = egui::MouseWheelUnit::Point;
            let (phase, modifiers) = (egui::TouchPhase::Move, egui::Modifiers::NONE);
            let source = egui::MouseWheelSource::Unknown;
            window.event(egui::Event::MouseWheel { unit, delta, phase, modifiers, source });
        }
        window.run_steps(1);
        for entry in window.state().panels().iter().flat_map(|panel| &panel.entries) {
            let (Value::Number(number), Some(soft)) = (&entry.value, entry.parameter.soft) else { continue };
            if entry.editability == Editability::Free {
                let first: f64 = entry.parameter.first.parse().expect("a number");
                let legal = soft.min.min(first)..=soft.max.max(first);
                assert!(legal.contains(number), "{} = {number} beyond {legal:?}", entry.name);
            }
        }
    }
    window.key_press(Key::Space);
    window.run_steps(1);
    let until = std::time::Instant::now() + std::time::Duration::from_secs(20);
    while host.request(None) != Ask::EmergencyStop {
        assert!(std::time::Instant::now() < until, "the stop did not arrive");
    }
}

#[test]
fn f1_lists_the_keys() {
    let (mut window, mut host, _folder) = live(&[]);
    until_fresh(&mut window, &mut host, |window| window.query_by_label("running").is_some());
    assert!(window.query_by_label("emergency stop; in a recording: play").is_none());
    window.key_press(Key::F1);
    window.run_steps(2);
    window.get_by_label("emergency stop; in a recording: play");
    window.key_press(Key::Escape);
    window.run_steps(2);
    assert!(window.query_by_label("emergency stop; in a recording: play").is_none());
}

/// Requests up to the emergency stop. Pictures are not made meanwhile: what is not under way already never comes.
fn up_to_the_stop(host: &mut FakeHost) {
    while host.request(None) != Ask::EmergencyStop {}
}

/// Makes the one picture that takes these events in.
fn one_picture(window: &mut Window<'_>, events: impl IntoIterator<Item = egui::Event>) {
    let before = window.ctx.cumulative_frame_nr();
    window.input_mut().events.extend(events);
    window.step();
    assert_eq!(window.ctx.cumulative_frame_nr(), before + 1);
}

fn space(pressed: bool) -> egui::Event {
    let modifiers = egui::Modifiers::NONE;
    egui::Event::Key { key: Key::Space, physical_key: None, pressed, repeat: false, modifiers }
}

fn button(pos: egui::Pos2, pressed: bool) -> egui::Event {
    let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
    egui::Event::PointerButton { pos, button, pressed, modifiers }
}

/// Whatever was clicked, pulled, turned and typed before: the picture that sees the space bar or the button let go has sent the
/// emergency stop.
#[test]
fn the_emergency_stop_is_on_its_way_within_one_picture_whatever_was_done_before() {
    let (mut window, mut host, _folder) = live(&[]);
    let stop = window.get_by_label("EMERGENCY STOP").rect().center();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |below: u16| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        u16::try_from(state % u64::from(below)).expect("it is below a u16")
    };
    let rounds = match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => 500,
        Ok("daily") => 20,
        _ => 2,
    };
    for round in 0..rounds {
        for _ in 0..20 {
            // Sliders and fields, and the 3D view; not the traces, which would write files.
            let is_side = random(2) == 0;
            let (x, y) =
                if is_side { (985 + random(290), 60 + random(690)) } else { (random(960), 60 + random(80)) };
            let pos = egui::pos2(f32::from(x), f32::from(y));
            let moved = egui::Event::PointerMoved(pos);
            let events = match random(6) {
                0 => vec![moved, button(pos, true), button(pos, false)],
                1 | 2 => vec![moved, button(pos, true)],
                3 => vec![moved, button(pos, false)],
                4 => vec![
                    moved,
                    egui::Event::Text(["4", "8", ".", "a", "?"][usize::from(random(5))].to_owned()),
                ],
                _ => {
                    const KEYS: [Key; 8] = [
                        Key::Tab,
                        Key::Escape,
                        Key::F1,
                        Key::P,
                        Key::M,
                        Key::Home,
                        Key::ArrowUp,
                        Key::Backspace,
                    ];
                    let modifiers = egui::Modifiers::NONE;
                    let key = KEYS[usize::from(random(8))];
                    let down = |pressed| egui::Event::Key {
                        key,
                        physical_key: None,
                        pressed,
                        repeat: false,
                        modifiers,
                    };
                    vec![moved, down(true), down(false)]
                }
            };
            one_picture(&mut window, events);
        }
        if round % 2 == 0 {
            one_picture(&mut window, [space(true), space(false)]);
        } else {
            // Whatever the mouse holds is released first.
            one_picture(&mut window, [egui::Event::PointerMoved(stop), button(stop, false)]);
            one_picture(&mut window, [egui::Event::PointerMoved(stop)]);
            one_picture(&mut window, [button(stop, true)]);
            one_picture(&mut window, [button(stop, false)]);
        }
        up_to_the_stop(&mut host);
    }
}
