//! View, light and dark, scale, and what is there the next time.

use super::window::{recorded, recording};
use egui::accesskit::Role;
use egui::{Key, Modifiers, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use flotor_history::quantity::Units;
use flotor_viewer::app::Viewer;
use flotor_viewer::palette::Look;

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

/// A key with Ctrl or Alt is another command than the key alone.
#[test]
fn a_key_with_a_modifier_turns_nothing() {
    let mut window = recording();
    let start = window.state().view().camera;
    for modifiers in [Modifiers::CTRL, Modifiers::COMMAND, Modifiers::ALT] {
        for key in [Key::A, Key::D, Key::W, Key::S, Key::L, Key::U, Key::P] {
            window.key_press_modifiers(modifiers, key);
            window.run_steps(1);
        }
    }
    assert_eq!(window.state().view().camera, start);
    assert_eq!((window.state().look(), window.state().plots().units), (Look::Dark, Units::Handy));
    window.key_press(Key::A);
    window.run_steps(1);
    assert_ne!(window.state().view().camera, start, "the key alone turns it");
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

/// Text twice as large: everything is still there.
#[test]
fn twice_the_scale_loses_nothing() {
    let harness = Harness::builder().with_size(vec2(960.0, 600.0)).with_pixels_per_point(2.0);
    let start = recorded(1000, None);
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
    let windows = [
        (1.0, [1280.0, 800.0]),
        (1.25, [1024.0, 640.0]),
        (1.5, [853.0, 533.0]),
        (2.0, [960.0, 600.0]),
        (2.0, [640.0, 400.0]),
    ];
    for (scale, size) in windows {
        let harness = Harness::builder().with_size(egui::Vec2::from(size)).with_pixels_per_point(scale);
        let start = recorded(1000, None);
        let mut window =
            harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Dark));
        window.run_steps(3);
        // Where there is no room for a row of traces, there is a menu of them.
        let has_menu = window.query_by_label("Traces").is_some();
        let choices = if has_menu { ["Traces", "Parameters (P)"] } else { ["Energy", "Lateness"] };
        let labels = [
            "A spring under test",
            "Force over time, N",
            "Position over time, mm",
            "Play",
            choices[0],
            choices[1],
            "Time shown",
            "Export",
            "Light (L)",
        ];
        let lowest = window.get_by_label("Play").rect().min.y;
        for trace in ["Force over time, N", "Position over time, mm"] {
            let area = window.get_by_label(trace).rect();
            assert!(area.height() >= 46.0, "{trace} at {scale} in {size:?} is too low: {area:?}");
            assert!(area.max.y <= lowest, "{trace} at {scale} in {size:?} lies behind what plays: {area:?}");
        }
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
    let saved_settings = left.state().settings();
    let mut next = recording();
    assert_ne!(next.state().settings(), saved_settings);
    let context = next.ctx.clone();
    next.state_mut().restore(&context, &saved_settings);
    next.run_steps(3);
    assert_eq!(next.state().settings(), saved_settings);
    next.get_by_label("Dark (L)");
    next.get_by_label("Energy over time, J");
    assert!(next.query_by_label("preset").is_none(), "the panel was put away");
}
