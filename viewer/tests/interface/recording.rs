//! A recording: played and scrubbed; its traces, in which units, where the moment is, and as files.

use super::window::{Window, recorded, recording, window};
use clap::ValueEnum;
use egui::Key;
use egui::accesskit::Role;
use egui_kittest::kittest::Queryable;
use flotor_history::player::Motion;
use flotor_history::quantity::Quantity;
use flotor_viewer::app::{Recorded, Start};
use flotor_viewer::display_options::DisplayOptions;
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{PictureError, PictureOptions, has_moment, least_height_px, picture};
use flotor_viewer::ui::export_options::ExportFormat;

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

/// The bar beneath and the numbers of the moment give one time, that of the sample, wherever between two samples somebody points.
#[test]
fn the_bar_has_the_time_of_the_sample_whose_numbers_stand_above_it() {
    let mut window = recording();
    for (pointed_s, shown) in [(1.2504, "   1.250 s"), (1.2596, "   1.259 s"), (2.0, "   2.000 s")] {
        window.get_by_role_and_label(Role::Slider, "Time").set_value_accesskit(pointed_s);
        window.run_steps(2);
        window.get_by_label(shown);
        let sample = window.state().history().at(pointed_s).expect("a sample");
        assert_eq!(format!("{:>8.3} s", sample.time_s()), shown);
    }
}

/// A window of time that is shorter than the run has the moment shown in it, wherever that is.
#[test]
fn traces_go_where_the_moment_is() {
    let mut window = window(recorded(30_000, Some(12.0)));
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
        flotor_viewer::export::write(viewer.history(), None, viewer.plots(), format, &path).expect("written");
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
fn traces_can_be_written_in_three_formats() {
    let mut window = recording();
    window.get_by_label("Export").click();
    window.run_steps(2);
    for format in ["CSV", "SVG", "PNG"] {
        window.get_by_role_and_label(Role::Button, format);
    }
    window.get_by_role_and_label(Role::SpinButton, "Width");
    window.get_by_role_and_label(Role::Button, "Light");
}

/// A spring that is pressed and released: the slope is its stiffness, and it takes no energy.
#[test]
fn force_over_position_says_stiffness_and_hysteresis() {
    let mut window = recording();
    window.get_by_role_and_label(Role::Button, "F(x)").click();
    window.run_steps(3);
    window.get_by_label_contains(
        "Force over position, N and mm: stiffness where there is force: 0.700 N/mm  ·  line through all: 0.700 N/mm",
    );
    window.get_by_label("Force over time, N");
    let viewer = window.state();
    let svg = flotor_viewer::export::svg(viewer.history(), None, viewer.plots());
    assert!(
        svg.contains("width=\"1800\" height=\"1000\" viewBox=\"0 0 900 500\"")
            && svg.contains("A spring under test")
    );
    assert!(svg.contains("0.700 N/mm") && !svg.contains("prefers-color-scheme"), "light, whatever the page");
}

/// The stiffness that the hand feels is a trace as any other, with gaps where the handle rests.
#[test]
fn the_stiffness_felt_is_a_trace() {
    let mut window = recording();
    window.get_by_role_and_label(Role::Button, "Stiffness").click();
    window.run_steps(2);
    window.get_by_label("Stiffness over time, N/mm");
    let felt = window.state().history().at(0.25).expect("a sample").stiffness_n_per_m;
    assert!((felt - 700.0).abs() < 1.0, "{felt}");
}

/// The traces of a command line are those of the window, of the picture of a moment and of a file.
#[test]
fn what_a_command_line_chooses_holds_in_a_window_and_in_a_picture() {
    let chosen = DisplayOptions::new(0, vec![Quantity::Energy, Quantity::Force, Quantity::Energy], Some(2));
    let mut window = recording();
    window.state_mut().choose(&chosen);
    window.run_steps(3);
    window.get_by_label("Energy over time, mJ");
    window.get_by_label_contains("Force over position, N and mm");
    assert!(window.query_by_label("Position over time, mm").is_none());

    let drawn = |chosen, size_px| {
        let Start::Recording(Recorded { histories, .. }) = recorded(1000, None) else {
            panic!("it is a recording")
        };
        let (scale, look) = (1.0, Look::Dark);
        picture(histories, &mut [], &PictureOptions { size_px, scale, look, view: None, chosen, at_s: None })
    };
    let usual = drawn(DisplayOptions::default(), [640, 600]).expect("a picture");
    assert_ne!(drawn(chosen, [640, 600]).expect("a picture"), usual);
    let explicit = DisplayOptions::new(0, vec![Quantity::Force, Quantity::Position], None);
    assert_eq!(drawn(explicit, [640, 600]).expect("a picture"), usual);
    let all = DisplayOptions::new(0, Quantity::value_variants().to_vec(), None);
    assert!(matches!(drawn(all, [640, 600]), Err(PictureError::TooLow(_))));
    // Whether the traces were chosen or not.
    let least_px = least_height_px(&DisplayOptions::default(), 1.0);
    drawn(DisplayOptions::default(), [640, least_px]).expect("they fit");
    assert!(matches!(drawn(DisplayOptions::default(), [640, least_px - 1]), Err(PictureError::TooLow(_))));
}

#[test]
fn a_moment_outside_the_recording_is_refused_with_its_ends() {
    let Start::Recording(Recorded { histories, .. }) = recorded(1000, None) else {
        panic!("it is a recording")
    };
    assert!(has_moment(&histories, 0.5).is_ok() && has_moment(&histories, 1.0).is_ok());
    for at_s in [99.0, -1.0, f64::NAN] {
        let said = has_moment(&histories, at_s).expect_err("it is outside").to_string();
        assert!(said.contains("0.0000 to 0.9990 s"), "{said}");
    }
}

/// A picture of many traces says how high it has to be, instead of drawing lines nobody can read.
#[test]
fn a_file_too_low_for_its_traces_is_refused_and_the_least_height_is_enough() {
    let mut window = recording();
    window.state_mut().choose(&DisplayOptions::new(0, Quantity::value_variants().to_vec(), None));
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut plots = window.state().plots().clone();
    let written = |plots: &_, format| {
        let path = folder.path().join("traces");
        flotor_viewer::export::write(window.state().history(), None, plots, format, &path)
    };
    for format in [ExportFormat::Svg, ExportFormat::Png] {
        plots.export.size_px = [1800.0, 1000.0];
        let said = written(&plots, format).expect_err("nine traces do not fit").to_string();
        assert!(said.contains("readable traces (9)") && said.contains("increase the height"), "{said}");
        plots.export.size_px[1] = flotor_viewer::export::least_height_px(&plots);
        written(&plots, format).expect("they fit");
    }
    plots.export.size_px = [1800.0, 100.0];
    written(&plots, ExportFormat::Csv).expect("numbers need no height");
}

/// Whoever has turned the view sees the way back.
#[test]
fn a_view_that_was_turned_has_a_button_that_resets_it() {
    let mut window = recording();
    assert!(window.query_by_label("Reset view").is_none());
    let camera = window.state().view().camera;
    window.key_press(Key::D);
    window.run_steps(2);
    assert_ne!(window.state().view().camera, camera);
    window.get_by_label("Reset view").click();
    window.run_steps(2);
    assert_eq!(window.state().view().camera, camera);
    assert!(window.query_by_label("Reset view").is_none());
}

/// Without a choice the largest force of a run fills its arrow, however small it is; with one the same force has the same arrow everywhere.
#[test]
fn arrows_of_a_chosen_force_are_equally_long_in_every_run() {
    let of_run = |ticks, arrow_force_n| {
        let Start::Recording(Recorded { histories, .. }) = recorded(ticks, None) else {
            panic!("it is a recording")
        };
        let chosen = DisplayOptions::default().with_arrow_force(arrow_force_n);
        let (size_px, scale, look, at_s) = ([320, 540], 1.0, Look::Dark, Some(0.1));
        let image =
            picture(histories, &mut [], &PictureOptions { size_px, scale, look, view: None, chosen, at_s });
        // The 3D view without legend, title and numbers.
        image.expect("a picture").region_by_pixels([100, 0], [60, 240])
    };
    assert_ne!(of_run(150, None), of_run(600, None), "both fill theirs");
    assert_eq!(of_run(150, Some(3.0)), of_run(600, Some(3.0)));
}
