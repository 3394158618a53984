//! Numbers that the book prints and no other test computes: tables of examples, what the simulated flotor declares, the size of a
//! recording.

use flotor_hal::abi::loader::Setting;
use flotor_session::registry::load_file;
use flotor_simulated::hand::Impedance;
use flotor_simulated::plant::FlotorParameters;
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use std::f64::consts::TAU;

#[allow(dead_code)] // times and picture
#[path = "../../examples/integrators.rs"]
mod integrators;
#[allow(dead_code)] // its `main`
#[path = "../../../devices/maglev/examples/penetration.rs"]
mod penetration;
#[allow(dead_code)] // the picture
#[path = "../../examples/velocity_estimators.rs"]
mod velocity_estimators;

const CHAPTER: &str = "simulated-flotor.md";

#[test]
fn the_book_prints_the_errors_of_the_integrators() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for error in integrators::errors() {
        assert_chapter_prints(CHAPTER, &format!("{},", error.line()));
    }
}

#[test]
fn the_book_prints_noise_and_lag_of_the_velocity_estimates() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for trade in velocity_estimators::trades().expect("physical parameters") {
        assert_chapter_prints(CHAPTER, &trade.line());
    }
}

/// A low-pass that takes the share `a` of a difference has `a / sqrt(2 - a)` of its noise and lags by `T (1 - a) / a` more.
#[test]
fn noise_and_lag_of_the_low_pass_are_its_closed_forms() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let trades = velocity_estimators::trades().expect("physical parameters");
    let [difference, ..] = trades.as_slice() else { panic!("no estimates") };
    let low_pass: Vec<_> = trades.iter().filter(|trade| trade.family == "low-pass").collect();
    assert!(low_pass.len() > 3, "{}", low_pass.len());
    for trade in low_pass {
        let share = 1.0 - (-TAU * trade.setting.expect("a bandwidth") * 1.0e-3).exp();
        let lag_ms = (1.0 - share) / share + 0.5;
        // The first difference of a run has faded to e^-12 at the end.
        assert!((trade.lag_ms / lag_ms - 1.0).abs() < 1.0e-3, "{}, not {lag_ms} ms", trade.line());
        let noise_mm_per_s = difference.noise_mm_per_s * share / (2.0 - share).sqrt();
        // Of 20 000 estimates about the share is independent: six deviations of their mean square's root.
        let bound = 6.0 / (2.0 * 20_000.0 * share).sqrt();
        let is_close = (trade.noise_mm_per_s / noise_mm_per_s - 1.0).abs() < bound;
        assert!(is_close, "{}, not {noise_mm_per_s} mm/s", trade.line());
    }
}

#[test]
fn the_book_prints_the_limits_of_the_coils() {
    let plugin = load_file(&plugin_file("flotor-simulated")).unwrap_or_else(|error| panic!("{error}"));
    let settings = [Setting::parse(plugin.parameters(), "preset", "full").expect("the plugin knows it")];
    let mut device = plugin.open_device(&settings).unwrap_or_else(|error| panic!("{error}"));
    let limits = device.capabilities().expect("it declares them");
    let [force, torque] = [limits.max_force_n, limits.max_torque_nm]
        .map(|most| (most.into_iter().fold(f64::INFINITY, f64::min), most.into_iter().fold(0.0, f64::max)));
    let text =
        format!("they give {:.1} to {:.1} N and {:.2} to {:.2} N·m", force.0, force.1, torque.0, torque.1);
    assert_chapter_prints(CHAPTER, &text);
}

#[test]
fn the_book_prints_the_hands_and_the_flotor() {
    for (grip, hand) in [("firm", Impedance::FIRM), ("relaxed", Impedance::RELAXED)] {
        let Impedance { mass_kg, damping_ns_per_m, stiffness_n_per_m, .. } = hand;
        let row = format!(
            "| `{grip}` | {mass_kg} kg | {} N·s/m | {} N/m |",
            damping_ns_per_m.x, stiffness_n_per_m.x
        );
        assert_chapter_prints(CHAPTER, &row);
    }
    let [thesis, utah] = [FlotorParameters::THESIS, FlotorParameters::UTAH];
    let inertia = (thesis.inertia_kg_m2 * 1.0e3).to_array().map(|moment| moment.to_string()).join(", ");
    let drag = thesis.drag;
    for row in [
        format!(
            "| mass | {:.3} kg (`flotor = \"thesis\"`), {:.3} kg (`utah`) |",
            thesis.mass_kg, utah.mass_kg
        ),
        format!("| centre of mass | {} mm below the origin |", -thesis.centre_of_mass_m.z * 1.0e3),
        format!("| moments of inertia | {inertia} g·m² |"),
        format!(
            "| drag | {} N·s/m, {} N·m·s/rad |",
            drag.translational_ns_per_m, drag.rotational_nms_per_rad
        ),
    ] {
        assert_chapter_prints(CHAPTER, &row);
    }
}

#[test]
fn the_book_prints_how_far_a_push_gets_into_the_wall_of_the_maglev_device() {
    for line in penetration::table(5.0) {
        assert_chapter_prints("devices/maglev.md", &line);
    }
}

/// Measured times are part of a tick and compress differently from run to run.
#[test]
fn a_recording_has_the_size_that_the_book_prints() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    let recording = file.display().to_string();
    let ran = Flotor::with(["run", "--clock", "virtual", "--duration", "30s", "--record", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let bytes = std::fs::metadata(file).expect("it was written").len() as f64 / 30_000.0;
    assert!((bytes / 463.0 - 1.0).abs() < 0.05, "{bytes} a tick");
    assert_chapter_prints("sizing.md", "| A recording | | 463 a tick: 0.46 MB/s at 1 kHz |");
}
