//! The pointer as the hand of a simulated device.

use super::texts::texts;
use super::window::{Window, live, recording, until};
use crate::support::FakeHost;
use egui::{Event, Modifiers, MouseWheelUnit, PointerButton, Pos2, vec2};
use egui_kittest::kittest::Queryable;
use flotor_core::trace::Events;
use flotor_live::{Ask, Outcome, SetValue};
use flotor_viewer::ui::handle::{DRAG, HINT};

fn button(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

/// Makes pictures, each with an event; egui tells a drag from a click by a few points of motion.
fn events(window: &mut Window<'_>, events: impl IntoIterator<Item = Event>) {
    for event in events {
        window.event(event);
        window.run_steps(1);
    }
}

/// The next request, which sets values; each parameter with its number.
fn set(host: &mut FakeHost) -> Vec<(String, f64)> {
    let Ask::Set { values } = host.request(None) else { panic!("something else was asked") };
    assert!(values.iter().all(|value| value.plugin == "device"), "{values:?}");
    values.into_iter().map(|value| (value.parameter, value.value.parse().expect("a number"))).collect()
}

/// The height of the target in the latest request before the one that releases the hand, and the number of the guide.
fn until_released(host: &mut FakeHost) -> (Vec<(String, f64)>, f64) {
    let (mut latest, mut guide) = (Vec::new(), 0.0);
    loop {
        let values = set(host);
        assert_eq!(values[0].0, "hand_guide", "who guides comes before the target");
        if values[0].1 == 0.0 {
            return (latest, guide);
        }
        guide = values[0].1;
        for value in &values[1..] {
            latest.retain(|(id, _)| *id != value.0);
            latest.push(value.clone());
        }
    }
}

fn coordinate(target: &[(String, f64)], axis: &str) -> f64 {
    let id = format!("hand_target_{axis}_mm");
    target.iter().find(|(known, _)| *known == id).expect("all three are sent").1
}

#[test]
fn a_dragged_handle_guides_the_hand_and_its_release_gives_it_back() {
    let (mut window, mut host, _folder) = live(&[]);
    let camera = window.state().view().camera;
    let start_mm = window.state().history().samples().last().expect("it ran").pose.position() * 1.0e3;
    let from = window.get_by_label(DRAG).rect().center();
    let view = window.get_by_label_contains("3D view").rect();
    let millimetre_pt = camera.pixels_per_mm(f64::from(view.height()));
    #[allow(clippy::cast_possible_truncation)]
    let down = vec2(0.0, 3.0 * millimetre_pt as f32);
    events(&mut window, [Event::PointerMoved(from), button(from, true), Event::PointerMoved(from + down)]);
    let wheel = Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: vec2(0.0, 100.0),
        phase: egui::TouchPhase::Move,
        modifiers: Modifiers::NONE,
        source: egui::MouseWheelSource::Unknown,
    };
    events(&mut window, [wheel]);
    window.run_steps(30); // the wheel is smoothed
    assert!(window.query_by_label(DRAG).is_some());
    events(&mut window, [button(from + down, false)]);
    window.run_steps(2);
    let (target, guide) = until_released(&mut host);
    assert!(guide >= 1.0);
    // Three millimetres at the point looked at; the handle is a little nearer to the eye or farther, and the picture is seen from above.
    let lowered_mm = start_mm.z - coordinate(&target, "z");
    assert!((2.5..3.7).contains(&lowered_mm), "{lowered_mm} mm");
    let beside_mm = (coordinate(&target, "x") - start_mm.x).hypot(coordinate(&target, "y") - start_mm.y);
    assert!((beside_mm - 2.0).abs() < 0.2, "{beside_mm} mm by the wheel: 100 points, 0.02 mm each");
    assert_eq!(window.state().view().camera, camera, "the view has not turned");
    host.nothing_is_asked();
}

#[test]
fn the_view_turns_where_the_handle_is_not() {
    let (mut window, mut host, _folder) = live(&[]);
    let camera = window.state().view().camera;
    let from = window.get_by_label(DRAG).rect().center() + vec2(-200.0, 40.0);
    let to = from + vec2(60.0, 0.0);
    events(
        &mut window,
        [Event::PointerMoved(from), button(from, true), Event::PointerMoved(to), button(to, false)],
    );
    assert_ne!(window.state().view().camera, camera);
    host.nothing_is_asked();
}

#[test]
fn a_hand_that_another_window_guides_is_left_alone_and_that_is_said() {
    let (mut window, mut host, _folder) = live(&[]);
    let from = window.get_by_label(DRAG).rect().center();
    let to = from + vec2(0.0, 30.0);
    events(&mut window, [Event::PointerMoved(from), button(from, true), Event::PointerMoved(to)]);
    let guide = set(&mut host)[0].1;
    let refused = SetValue {
        plugin: "device".to_owned(),
        parameter: "hand_guide".to_owned(),
        value: guide.to_string(),
    };
    host.changed(&refused, Outcome::Refused);
    until(&mut window, |window| window.query_by_label_contains("Another window guides this hand").is_some());
    events(&mut window, [Event::PointerMoved(to + vec2(0.0, 30.0)), button(to, false)]);
    window.run_steps(3);
    for ask in host.all_requests() {
        let Ask::Set { values } = ask else { panic!("something else was asked: {ask:?}") };
        assert_ne!(values[0].value, "0", "what another window holds is not released");
    }
    events(&mut window, [Event::PointerMoved(from), Event::PointerMoved(to)]);
    host.nothing_is_asked();
}

#[test]
fn a_recording_and_a_run_that_is_looked_back_at_have_nothing_to_drag() {
    let has_hint = |window: &Window<'_>| texts(window.output()).iter().any(|text| text.words == HINT);
    let recording = recording();
    assert!(recording.query_by_label(DRAG).is_none() && !has_hint(&recording));
    let (mut window, mut host, _folder) = live(&[]);
    assert!(window.query_by_label(DRAG).is_some() && has_hint(&window));
    window.key_press(egui::Key::ArrowLeft);
    window.run_steps(2);
    assert!(window.query_by_label(DRAG).is_none() && !has_hint(&window));
    host.run_ticks(1, Events::NONE);
}

/// While a handle is dragged, each picture changes up to four parameters; marks of all would cover the others.
#[test]
fn a_drag_makes_no_marks_on_the_time_axis_and_another_change_does() {
    let (mut window, mut host, _folder) = live(&[]);
    let change = |host: &mut FakeHost, plugin: &str, parameter: &str| {
        let [plugin, parameter] = [plugin, parameter].map(str::to_owned);
        host.changed(&SetValue { plugin, parameter, value: "5.0".to_owned() }, Outcome::Applied);
        host.run_ticks(10, Events::PARAMETER_CHANGED);
    };
    let is_marked =
        |window: &Window<'_>| window.query_by_label("Marked on the time axis: parameter changed").is_some();
    change(&mut host, "device", "hand_guide");
    change(&mut host, "device", "hand_target_z_mm");
    until(&mut window, |window| window.state().history().len() >= 1520);
    window.run_steps(2);
    assert!(!is_marked(&window));
    change(&mut host, "spring", "gamma_n");
    until(&mut window, is_marked);
}
