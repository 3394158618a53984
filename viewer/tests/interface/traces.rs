//! The traces under a person's hands: pulled larger, zoomed, one in the room of all.

use super::window::{Window, recorded, recording};
use egui::accesskit::Role;
use egui::epaint::Shape;
use egui::{Key, PointerButton, Pos2, Rect, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use flotor_history::quantity::Quantity;
use flotor_viewer::app::Viewer;
use flotor_viewer::palette::Look;

const FORCE: &str = "Force over time, N";

fn area(window: &Window<'_>, label: &str) -> Rect {
    window.get_by_label(label).rect()
}

fn span_s(window: &Window<'_>) -> [f64; 2] {
    window.state().plots().span_s(window.state().history())
}

fn button(window: &mut Window<'_>, button: PointerButton, at: Pos2, pressed: bool) {
    window.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers: egui::Modifiers::NONE });
    window.run_steps(1);
}

fn drag(window: &mut Window<'_>, with: PointerButton, from: Pos2, to: Pos2) {
    window.hover_at(from);
    window.run_steps(1);
    button(window, with, from, true);
    for part in [0.5, 1.0] {
        window.hover_at(from + (to - from) * part);
        window.run_steps(1);
    }
    button(window, with, to, false);
    window.run_steps(2);
}

/// Five traces in a small window at twice the scale: each is high enough to be read, and the others are scrolled to.
#[test]
fn five_traces_at_twice_the_scale_can_be_read() {
    let harness = Harness::builder().with_size(vec2(640.0, 400.0)).with_pixels_per_point(2.0);
    let start = recorded(1000, None);
    let mut window =
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Dark));
    window.run_steps(3);
    for name in ["Energy", "Torque", "Velocity"] {
        window.get_by_label("Traces").click();
        window.run_steps(2);
        window.get_by_role_and_label(Role::Button, name).click();
        window.run_steps(2);
        window.key_press(Key::Escape);
        window.run_steps(2);
    }
    // From the top, and with the wheel to the others: those in sight can be read, and the number of the others is said.
    let all = [
        FORCE,
        "Torque over time, mN·m",
        "Position over time, mm",
        "Velocity over time, mm/s",
        "Energy over time, mJ",
    ];
    let in_sight = |window: &Window<'_>| {
        let shown: Vec<&str> =
            all.into_iter().filter(|label| window.query_by_label(label).is_some()).collect();
        shown.iter().for_each(|label| assert!(area(window, label).height() >= 46.0, "{label} is too low"));
        shown
    };
    let first = in_sight(&window);
    assert!(first.starts_with(&all[..1]) && first.len() < all.len(), "{first:?}");
    window.get_by_label(&format!("{} more below", all.len() - first.len()));
    for _ in 0..40 {
        window.hover_at(area(&window, in_sight(&window)[0]).center());
        let (unit, delta) = (egui::MouseWheelUnit::Point, vec2(0.0, -20.0));
        let (modifiers, phase) = (egui::Modifiers::NONE, egui::TouchPhase::Move);
        window.event(egui::Event::MouseWheel {
            unit,
            delta,
            modifiers,
            phase,
            source: egui::MouseWheelSource::Unknown,
        });
        window.run_steps(2);
    }
    assert!(in_sight(&window).ends_with(&all[4..]), "{:?}", in_sight(&window));
    window.get_by_label_contains("more above");
}

#[test]
fn the_border_between_view_and_traces_is_pulled_and_stays() {
    let mut window = recording();
    let border = area(&window, "Border between view and traces").center();
    let before = area(&window, FORCE).height();
    drag(&mut window, PointerButton::Primary, border, border - vec2(0.0, 150.0));
    let after = area(&window, FORCE).height();
    assert!((after - before - 75.0).abs() < 4.0, "half of what was pulled each: {before} to {after}");
    let kept = window.state().settings();
    let mut next = recording();
    let context = next.ctx.clone();
    next.state_mut().restore(&context, &kept);
    next.run_steps(3);
    assert!((area(&next, FORCE).height() - after).abs() < 1.0, "the next time, too");
}

#[test]
fn a_box_a_wheel_and_a_double_click_zoom() {
    let mut window = recording();
    let force = area(&window, FORCE);
    let all_s = span_s(&window);
    let at = |x: f32, y: f32| force.min + vec2(x * force.width(), y * force.height());
    let now_s = window.state().player().now_s;
    drag(&mut window, PointerButton::Secondary, at(0.3, 0.2), at(0.6, 0.7));
    let boxed_s = span_s(&window);
    let part = (boxed_s[1] - boxed_s[0]) / (all_s[1] - all_s[0]);
    assert!((0.25..0.4).contains(&part) && boxed_s[0] > all_s[0], "{boxed_s:?} of {all_s:?}");
    let values = window.state().plots().values_of(Quantity::Force).expect("values, too");
    assert_eq!(window.state().plots().values_of(Quantity::Position), None, "of this trace only");
    assert_eq!(window.state().player().now_s, now_s, "a box is no other moment");

    window.hover_at(at(0.5, 0.5));
    window.run_steps(1);
    window.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 60.0),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: egui::Modifiers::NONE,
    });
    window.run_steps(20);
    let nearer = window.state().plots().values_of(Quantity::Force).expect("still zoomed");
    assert!(nearer[1] - nearer[0] < values[1] - values[0], "{nearer:?} in {values:?}");
    assert_eq!(span_s(&window), boxed_s, "the time is as it was");

    let middle = at(0.5, 0.5);
    drag(&mut window, PointerButton::Middle, middle, middle + vec2(50.0, 0.0));
    let shifted_s = span_s(&window);
    assert!(shifted_s[0] < boxed_s[0], "{shifted_s:?}");
    for _ in 0..2 {
        button(&mut window, PointerButton::Primary, middle, true);
        button(&mut window, PointerButton::Primary, middle, false);
    }
    window.run_steps(2);
    assert_eq!(span_s(&window), all_s);
    assert_eq!(window.state().plots().values_of(Quantity::Force), None);
}

#[test]
fn one_trace_takes_the_room_of_all_and_gives_it_back() {
    let mut window = recording();
    let before = area(&window, FORCE).height();
    window.get_by_label("Force alone (M)").click();
    window.run_steps(2);
    assert!(area(&window, FORCE).height() > 1.8 * before);
    assert!(window.query_by_label("Position over time, mm").is_none());
    window.get_by_label("All traces (M)").click();
    window.run_steps(2);
    assert!((area(&window, FORCE).height() - before).abs() < 1.0);
    window.key_press(Key::M);
    window.run_steps(2);
    assert!(window.query_by_label("Position over time, mm").is_none());
}

/// The widths of the lines of a picture, points.
fn line_widths(shape: &Shape, widths: &mut Vec<f32>) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| line_widths(shape, widths)),
        Shape::Path(path) => widths.push(path.stroke.width),
        _ => {}
    }
}

/// The force is along z alone, so the traces of x and y lie over one another: the lower one is seen beside the upper one.
#[test]
fn a_covered_trace_is_wider_than_the_one_that_covers_it() {
    let window = recording();
    let mut widths = Vec::new();
    window.output().shapes.iter().for_each(|clipped| line_widths(&clipped.shape, &mut widths));
    let count = |wanted: f32| widths.iter().filter(|width| (*width - wanted).abs() < 1.0e-3).count();
    // Force and position: x under y, and y and z in the width of a trace.
    assert!(count(5.0) == 2 && count(1.6) >= 4, "{widths:?}");
}
