//! Numbers that the book prints and no other test computes: tables of examples, what the simulated flotor declares, the size of a
//! recording.

use flotor_loader::Setting;
use flotor_session::registry::load_file;
use flotor_simulated::hand::Impedance;
use flotor_simulated::plant::FlotorParameters;
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tables::{Row, number, table};

#[allow(dead_code)] // times and picture
#[path = "../../examples/integrators.rs"]
mod integrators;
#[allow(dead_code)] // its `main`
#[path = "../../../devices/maglev/examples/penetration.rs"]
mod penetration;
#[allow(dead_code)] // its `main`
#[path = "../../examples/release_oscillation.rs"]
mod release_oscillation;
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
fn the_book_prints_how_a_released_spring_oscillates() {
    for line in release_oscillation::lines().expect("the flotor swings") {
        assert_chapter_prints("models/spring/corrections.md", &line);
    }
}

/// The table is of an implementation of its own, `tests/generators/integrators.py`. The plant has no row there: its errors are rounding.
#[test]
fn errors_of_the_integrators_are_those_of_an_independent_implementation() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    // Both references are within some 1e-11 of the exact attitude: 16 000 roundings of 2.2e-16 and more.
    const ROUNDING: f64 = 1.5e-11;
    let rows = table("integrators.csv");
    let mut compared = 0;
    for error in integrators::errors() {
        let (name, step_s) = error.case();
        let is_of = |row: &&Row| row["method"] == name && number(row, "step_s") == step_s;
        let expected_rad = rows.iter().find(is_of).map_or(0.0, |row| number(row, "error_rad"));
        // The table has five digits.
        let tolerance_rad = 1.0e-4 * expected_rad + ROUNDING;
        assert!(
            (error.error_rad - expected_rad).abs() <= tolerance_rad,
            "{}, not {expected_rad}",
            error.line()
        );
        compared += usize::from(expected_rad > 0.0);
    }
    assert_eq!(compared, rows.len());
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

/// Compares noise and lag with a table from transfer functions, Riccati and Lyapunov equations (`tests/generators/velocity.py`).
#[test]
fn noise_and_lag_of_the_velocity_estimates_are_those_of_their_transfer_functions() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let trades = velocity_estimators::trades().expect("physical parameters");
    let rows = table("velocity_estimates.csv");
    assert_eq!(trades.len(), rows.len());
    for (trade, row) in trades.iter().zip(&rows) {
        let setting = trade.setting.map_or_else(String::new, |number| number.to_string());
        assert_eq!((trade.family, &setting), (row["estimate"].as_str(), &row["setting"]));
        // The start of a run has faded to e^-12 of a lag of 32 ms, and of the sum of squares to its square.
        let (noise_mm_per_s, lag_ms) = (number(row, "noise_mm_per_s"), number(row, "lag_ms"));
        let is_close = (trade.noise_mm_per_s / noise_mm_per_s - 1.0).abs() < 1.0e-4;
        assert!(is_close && (trade.lag_ms - lag_ms).abs() < 1.0e-3, "{}, not {row:?}", trade.line());
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
    let lines = penetration::table(5.0);
    for line in &lines {
        assert_chapter_prints("devices/maglev.md", line);
    }
    // A push of F on a flotor of m rests at F / K; on the way there it gets twice as far, and as much farther as the handle moves, at
    // F / sqrt(K m), until the force follows: a period and the delay.
    let (push_n, mass_kg, rows) = (5.0, 0.58, &lines[2..]);
    assert_eq!(rows.len(), 4);
    for row in rows {
        let numbers: Vec<f64> = row.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let [delay_ms, stiffness_n_per_m, at_rest_mm, at_most_mm] = numbers[..] else { panic!("{row}") };
        let rest_mm = 1.0e3 * push_n / stiffness_n_per_m;
        let most_mm = 2.0 * rest_mm + push_n / (stiffness_n_per_m * mass_kg).sqrt() * (1.0 + delay_ms);
        // Half a unit of the last digit printed.
        assert!(
            (at_rest_mm - rest_mm).abs() < 5.1e-4 && (at_most_mm - most_mm).abs() < 5.1e-4,
            "{row}: {rest_mm}, {most_mm}"
        );
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
