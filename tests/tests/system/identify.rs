//! `flotor identify` on what the program itself makes: a recording of a run, a table of the spring's own law, and input that no law can
//! be found from.

use super::study_scripts::science_python;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Stiffness of spring 1 at the handle, N/m: `gamma / L0`, with 25 mm of the spring on 15 mm of the handle.
const DEMO_N_PER_M: f64 = 16.97 / 0.025 * (25.0 / 15.0);

fn flotor(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(arguments).inside(folder).run()
}

fn identified(folder: &Path, arguments: &[&str]) -> Value {
    let ran = flotor(folder, &[&["identify"], arguments, &["--json", "-"]].concat());
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    serde_json::from_str(&ran.stdout).expect("the result is JSON")
}

/// Returns value and ends of the interval of a parameter.
fn parameter(result: &Value, id: &str) -> [f64; 3] {
    let parameters = result["parameters"].as_array().expect("the parameters are a list");
    let one = parameters.iter().find(|one| one["id"] == id).unwrap_or_else(|| panic!("{id} in {result}"));
    ["value", "low", "high"].map(|key| one[key].as_f64().expect("a number"))
}

#[test]
fn a_recording_of_the_demo_is_a_linear_spring_of_its_own_stiffness() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let run = ["run", "--clock", "virtual", "--duration", "4s", "--record", "run.mcap"];
    assert_eq!(flotor(folder, &run).code, Some(exit_code::OK));
    let found = identified(folder, &["run.mcap", "--out", "spring"]);
    assert_eq!(found["law"], "linear", "{found}");
    let [value, low, high] = parameter(&found, "stiffness_n_per_m");
    assert!(low < DEMO_N_PER_M && DEMO_N_PER_M < high && high - low < 0.01 * value, "{found}");
    // Force and pose of a tick are a period apart: the force acts during the next one.
    let delay_s = found["delay_s"]["value"].as_f64().expect("a recording has times");
    assert!((delay_s - 1.0e-3).abs() < 1.0e-4, "{found}");
    // The scene of the folder feels as the recorded one: the measured curve has the same stiffness at the handle.
    let again =
        ["run", "spring/scene.toml", "--clock", "virtual", "--duration", "4s", "--record", "again.mcap"];
    assert_eq!(flotor(folder, &again).code, Some(exit_code::OK));
    let felt = identified(folder, &["again.mcap", "--law", "linear"]);
    let [again, _, _] = parameter(&felt, "stiffness_n_per_m");
    assert!((again / value - 1.0).abs() < 0.02, "{again} {value}");
}

/// A table without times, as `eval` writes it: the force of spring 1 over its compression.
#[test]
fn a_table_of_the_model_gives_its_law() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let places_mm = || (0..200).map(|index| f64::from(index) * 0.05);
    let mut poses = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n".to_owned();
    places_mm().for_each(|mm| writeln!(poses, "0,0,{},0,0,0", -mm * 1.0e-3).expect("a text takes all"));
    let _ = scratch.file("poses.csv", poses);
    let eval = flotor(folder, &["eval", "--model", "spring", "--poses", "poses.csv", "--out", "-"]);
    assert_eq!(eval.code, Some(exit_code::OK), "{eval:#?}");
    let mut rows = eval.stdout.lines();
    let column = rows.next().and_then(|header| header.split(',').position(|name| name == "fz_n"));
    let column = column.expect("the force has a column");
    let mut table = "displacement_mm,force_n\n".to_owned();
    for (mm, row) in places_mm().zip(rows) {
        let force_n = row.split(',').nth(column).expect("a row has all columns");
        writeln!(table, "{mm},{force_n}").expect("a text takes all");
    }
    let _ = scratch.file("spring.csv", table);
    let found = identified(folder, &["spring.csv"]);
    assert_eq!((&found["law"], found.get("delay_s")), (&Value::from("linear"), None), "{found}");
    let [value, low, high] = parameter(&found, "stiffness_n_per_m");
    let truth = 16.97 / 0.025;
    assert!(low <= value && value <= high && (value / truth - 1.0).abs() < 1.0e-3, "{found}");
}

#[test]
fn input_without_a_law_is_refused_in_one_line_with_a_remedy() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let run = [
        "run",
        "--clock",
        "virtual",
        "--duration",
        "1s",
        "--set",
        "device.hand=open",
        "--record",
        "still.mcap",
    ];
    assert_eq!(flotor(folder, &run).code, Some(exit_code::OK));
    let rows: String = (0..50).map(|row| format!("{row},{row}\n")).collect();
    let _ = scratch.file("static.csv", format!("displacement_mm,force_n\n{rows}"));
    for (arguments, says) in [
        (&["still.mcap", "--axis", "x"][..], "`still.mcap`: the displacement is constant; press the object"),
        (&["static.csv", "--law", "zener"], "static.csv: the law `zener` depends on the velocity"),
        (&["none.csv"], "none.csv: cannot read the measurement"),
    ] {
        let ran = flotor(folder, &[&["identify"], arguments].concat());
        assert!(ran.error().starts_with(says), "{ran:#?}");
        assert!(matches!(ran.code, Some(exit_code::CONFIGURATION | exit_code::OTHER)), "{ran:#?}");
    }
}

/// Least squares of Hertz's law by SciPy: value and standard error of the amplitude and the contact.
const CURVE_FIT: &str = "
import numpy as np, scipy.optimize as so
x, f = np.loadtxt('ball.csv', delimiter=',', skiprows=1).T * [[1e-3], [1]]
law = lambda x, k, c: k * np.maximum(x - c, 0) ** 1.5
value, covariance = so.curve_fit(law, x, f, p0=[1e4, 5e-4])
print(*value, *np.sqrt(np.diag(covariance)))
";

#[test]
fn values_and_errors_of_a_curve_without_times_are_those_of_scipy() {
    let Some(python) = science_python() else { return };
    let scratch = Scratch::default();
    let mut table = "displacement_mm,force_n\n".to_owned();
    for index in 0..3000_u32 {
        let (mm, phase) = (f64::from(index) * 1.0e-3, f64::from(index) * f64::from(index) * 0.7);
        let force_n = 0.6 * (mm - 0.7_f64).max(0.0).powf(1.5) + 0.02 * phase.sin();
        writeln!(table, "{mm},{force_n}").expect("a text takes all");
    }
    let _ = scratch.file("ball.csv", table);
    let output = Command::new(python).args(["-c", CURVE_FIT]).current_dir(scratch.path()).output();
    let output = output.expect("Python starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<f64> = text.split_whitespace().map(|number| number.parse().expect("a number")).collect();
    let [k, contact_m, k_error, contact_error] = numbers[..] else { panic!("{output:?}") };
    let found = identified(scratch.path(), &["ball.csv", "--law", "hertz"]);
    for (id, theirs, error) in [("hertz_n_per_m_1_5", k, k_error), ("contact_m", contact_m, contact_error)] {
        let [value, low, high] = parameter(&found, id);
        // The same least squares, here of means of some samples: they differ by a part of the error itself.
        assert!((value - theirs).abs() < 0.5 * error, "{id}: {value}, not {theirs} ± {error}");
        // Theirs takes the noise as white with one variance; the estimate of ours from some hundred means has a tenth of error.
        assert!(
            (0.7..1.4).contains(&((high - low) / (3.92 * error))),
            "{id}: {low} to {high}, not ± {error}"
        );
    }
}
