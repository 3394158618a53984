//! What the passivity controller and the slew limit prevent, and what they let pass: forces of hands on walls and springs.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, rotation_vector};
use flotor_servo::RunEnd;
use flotor_tests::TestSize;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::watched::{Watched, watch};
use rayon::prelude::*;
use serde_json::Value;

const SCRIPTS: [&str; 7] = flotor_simulated::hand::Script::NAMES;
/// Models and their stiffness along z, N/m: a spring and two walls.
const MODELS: [(&str, f64); 3] = [
    ("plugin = \"wall\"\n[model.parameters]\nstiffness_n_per_m = 2000\nheight_mm = -1", 2000.0),
    ("plugin = \"wall\"\n[model.parameters]\nstiffness_n_per_m = 20000\nheight_mm = -1", 20_000.0),
    ("plugin = \"spring\"", 1130.0),
];

fn scripted(script: &str, model: &str, rate_hz: f64, passivity: &str) -> Watched {
    watch(&format!(
        "rate_hz = {rate_hz}\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand_script = \"{script}\"\n\
         [[model]]\n{model}\n[limits]\npassivity = \"{passivity}\"\n"
    ))
}

fn peak_n(run: &Watched) -> f64 {
    run.records.iter().map(|record| record.commanded.force().length()).fold(0.0, f64::max)
}

/// The lowest energy that hands have put into a port less what they received, J: the wrenches that were delivered, over the ways
/// of the poses.
fn lowest_port_j(records: &[TickRecord]) -> f64 {
    let mut energy_j = 0.0;
    let steps = records.windows(2).map(|pair| {
        let way: DVec3 = pair[1].pose.position() - pair[0].pose.position();
        let turn = rotation_vector(pair[1].pose.orientation() * pair[0].pose.orientation().conjugate());
        energy_j -= pair[1].delivered.force().dot(way) + pair[1].delivered.torque().dot(turn);
        energy_j
    });
    steps.fold(0.0, f64::min)
}

/// Energy `K a² T⁴ / 8` of a spring over the distance that a handle covers from rest at 50 m/s² in one period, J.
fn energy_of_a_start_j(stiffness_n_per_m: f64, rate_hz: f64) -> f64 {
    stiffness_n_per_m * 2500.0 / (8.0 * rate_hz.powi(4))
}

/// A scripted hand on a model at one rate, with the controller and without.
#[derive(Debug)]
struct Cell {
    script: &'static str,
    stiffness_n_per_m: f64,
    rate_hz: f64,
    /// Peak force without the controller at 4 kHz, N.
    fine_n: f64,
    /// Peak force without the controller, N.
    free_n: f64,
    /// Peak force with the controller, N.
    kept_n: f64,
    /// Lowest port energy with the controller, J.
    lowest_j: f64,
    /// Outcome of the run with the controller.
    end: RunEnd,
}

impl Cell {
    fn run(
        script: &'static str,
        (model, stiffness_n_per_m): &(&str, f64),
        rate_hz: f64,
        fine_n: f64,
    ) -> Self {
        let [free, kept] =
            ["observe", "control"].map(|passivity| scripted(script, model, rate_hz, passivity));
        let [free_n, kept_n] = [&free, &kept].map(peak_n);
        let lowest_j = lowest_port_j(&kept.records);
        let stiffness_n_per_m = *stiffness_n_per_m;
        Self { script, stiffness_n_per_m, rate_hz, fine_n, free_n, kept_n, lowest_j, end: kept.outcome.end }
    }

    /// Returns the reserve that the chapter states, J.
    fn reserve_j(&self) -> f64 {
        energy_of_a_start_j(200.0, self.rate_hz)
    }

    fn bound_j(&self) -> f64 {
        energy_of_a_start_j(self.stiffness_n_per_m, self.rate_hz)
    }

    /// Returns the part of the reserve that left the port; more than 1: beyond the reserve.
    fn of_the_reserve(&self) -> f64 {
        -self.lowest_j / self.reserve_j()
    }

    /// Returns true if more energy left the port than the reserve, beyond the error of rotations of the controller (1e-6).
    fn is_beyond_the_reserve(&self) -> bool {
        self.of_the_reserve() > 1.0 + 1.0e-6
    }

    fn is_right(&self) -> bool {
        self.fine_n > 0.1
            && self.kept_n >= 0.95 * self.fine_n
            && self.kept_n <= 1.05 * self.free_n
            && !self.is_beyond_the_reserve()
            && self.reserve_j() <= self.bound_j()
            && self.end == RunEnd::Finished
    }
}

impl std::fmt::Display for Cell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} at {} Hz on {} N/m: port energy {:.2e} J or more, {:.6} of the reserve of {:.2e} J; bound {:.2e} J",
            self.script,
            self.rate_hz,
            self.stiffness_n_per_m,
            self.lowest_j,
            self.of_the_reserve(),
            self.reserve_j(),
            self.bound_j()
        )
    }
}

/// The controller once assumed that a handle might start at 50 m/s² in any tick: each contact slower than 25 mm/s at 1 kHz, and 100 mm/s
/// at 250 Hz, had no force for as long as it lasted.
#[test]
fn every_script_of_a_hand_feels_its_contact_and_gets_no_more_energy_than_the_book_states() {
    let rates: &[f64] = match TestSize::of_this_run() {
        TestSize::Quick => &[250.0, 1000.0],
        TestSize::Daily | TestSize::Full => &[250.0, 500.0, 1000.0, 2000.0, 4000.0],
    };
    let cases: Vec<_> =
        MODELS.iter().flat_map(|model| SCRIPTS.iter().map(move |script| (model, script))).collect();
    let cells: Vec<Cell> = cases
        .par_iter()
        .flat_map_iter(|(model, script)| {
            let fine_n = peak_n(&scripted(script, model.0, 4000.0, "observe"));
            rates.iter().map(move |rate_hz| Cell::run(script, model, *rate_hz, fine_n))
        })
        .collect();
    cells.iter().for_each(|cell| println!("{cell}"));
    let wrong: Vec<String> =
        cells.iter().filter(|cell| !cell.is_right()).map(|cell| format!("{cell}: {cell:?}")).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let more = cells.iter().filter(|cell| cell.of_the_reserve() > 0.5 + 1.0e-6).count();
    let most = cells.iter().map(Cell::of_the_reserve).fold(0.0, f64::max);
    let line = format!(
        "{} of these {} runs take at most that half, the {more} others up to {:.0} % of the reserve",
        cells.len() - more,
        cells.len(),
        most * 100.0,
    );
    println!("{line}");
    if TestSize::of_this_run() > TestSize::Quick {
        assert_chapter_prints("safety-envelope.md", &line);
    }
}

/// A free handle with 5 N of its weight left, laid down next to the boundary.
#[test]
fn the_boundary_holds_a_weight_with_the_controller_as_without() {
    let laid = |rate_hz: f64, passivity: &str| {
        watch(&format!(
            "rate_hz = {rate_hz}\nduration_s = 4\n[device]\nplugin = \"simulated\"\n[device.parameters]\n\
             hand = \"open\"\nfeedforward_n = 0.69\nstart_z_mm = -8.5\n[boundary]\nmargin_mm = 3\n\
             [[model]]\nplugin = \"wall\"\n[model.parameters]\nheight_mm = -40\n[limits]\n\
             passivity = \"{passivity}\"\n"
        ))
    };
    for rate_hz in [250.0, 1000.0, 4000.0] {
        let [free, kept] = ["observe", "control"].map(|passivity| laid(rate_hz, passivity));
        for run in [&free, &kept] {
            assert_eq!(run.outcome.end, RunEnd::Finished, "{rate_hz} Hz");
            let last = run.records.last().expect("ticks");
            assert!(last.events.intersects(Events::BOUNDARY), "{rate_hz} Hz");
            // Less what the last bounces leave.
            assert!((last.commanded.force().z - 5.0).abs() < 0.1, "{rate_hz} Hz: {last:?}");
        }
    }
}

/// The demo's spring and a wall at its stable stiffness under a slow force: its lag threw the handle out of the range.
#[test]
fn a_slew_limit_lets_a_free_handle_come_to_rest() {
    let demo = |start_mm: f64| {
        let open = format!("[device.parameters]\nhand = \"open\"\nstart_z_mm = {start_mm}");
        flotor_session::scene::DEMO.replace("[device.parameters]", &open)
    };
    let wall = "[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"open\"\nstart_z_mm = 3\n\
                feedforward_n = 4\n[[model]]\nplugin = \"wall\"\n[model.parameters]\nstiffness_n_per_m = 4000\n\
                height_mm = -1\n";
    let cases = [
        (demo(-6.0), 100.0, 0.0),
        (demo(-3.0), 50.0, 0.0),
        (demo(-6.0), 50.0, 0.0),
        (wall.to_owned(), 500.0, -1.4e-3),
    ];
    for (scene, slew_n_per_s, rest_m) in cases {
        let run = watch(&format!("{scene}[limits]\nforce_slew_n_per_s = {slew_n_per_s}\n"));
        assert_eq!(run.outcome.end, RunEnd::Finished, "{slew_n_per_s} N/s: {scene}");
        assert!(run.records.iter().any(|record| record.events.intersects(Events::SLEW_LIMITED)));
        let last = run.records.iter().rev().take(500).map(|record| record.pose.position().z);
        let farthest_m = last.map(|z_m| (z_m - rest_m).abs()).fold(0.0, f64::max);
        assert!(farthest_m < 0.5e-3, "{slew_n_per_s} N/s: {farthest_m} m from rest: {scene}");
    }
}

#[test]
fn the_summary_has_energy_and_time_of_controller_and_slew_limit() {
    let scene = "duration_s = 4\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\n[[model]]\n\
                 plugin = \"spring\"\n[limits]\npassivity = \"control\"\nforce_slew_n_per_s = 20\n";
    let scratch = flotor_tests::scratch::Scratch::default();
    let file = scratch.file("scene.toml", scene).display().to_string();
    let ran = Flotor::with(["run", &file, "--clock", "virtual", "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let json: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    let run = watch(scene);
    let ticks = |event| run.records.iter().filter(|record| record.events.intersects(event)).count();
    let number = |key: &str| json["envelope"][key].as_f64().unwrap_or_else(|| panic!("{key}: {json}"));
    for (key, event) in
        [("passivity_active_s", Events::PASSIVITY_DAMPED), ("slew_active_s", Events::SLEW_LIMITED)]
    {
        assert!(ticks(event) > 0, "{key}");
        assert!((number(key) - ticks(event) as f64 * 1.0e-3).abs() < 1.0e-9, "{key}: {json}");
    }
    assert_eq!(json["envelope"], json["devices"][0]["envelope"], "one device");
    let text = Flotor::with(["run", &file, "--clock", "virtual"]).run();
    for row in ["passivity", "slew limit"] {
        assert!(text.stdout.lines().any(|line| line.trim_start().starts_with(row)), "{row}: {text:?}");
    }
}
