//! The program as scripts call it. As an integration test of this crate it also makes `cargo test` build the program, which the tests
//! of the workspace then run from beside the plugins.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn identify(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_flotor-identify");
    Command::new(program).current_dir(folder).args(arguments).output().expect("the program starts")
}

/// Writes a table of two slow strokes of 3 mm into a thing at 0.5 mm with this force over depth (m) and velocity (m/s).
fn table(folder: &Path, header: &str, factor: f64, force_n: impl Fn(f64, f64) -> f64) {
    let mut text = format!("# two strokes\n{header}\n");
    for index in 0..2000_u32 {
        let time_s = f64::from(index) * 5.0e-3;
        let phase = time_s % 5.0;
        let (x, v) = if phase < 2.5 {
            (phase / 2.5 * 3.0e-3, 1.2e-3)
        } else {
            (6.0e-3 - phase / 2.5 * 3.0e-3, -1.2e-3)
        };
        let noise_n = 0.005 * (f64::from(index) * f64::from(index) * 0.7).sin();
        text += &format!("{time_s},{},{}\n", x * factor, force_n((x - 0.5e-3).max(0.0), v) + noise_n);
    }
    std::fs::write(folder.join("thing.csv"), text).expect("the table can be written");
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("the output is JSON")
}

#[test]
fn the_version_is_that_of_the_crate() {
    let output = identify(Path::new("."), &["--version"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), concat!("flotor ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn a_ball_is_hertz_with_its_numbers_and_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    table(folder.path(), "time_s,displacement_mm,force_n", 1.0e3, |d, _| 3.0e4 * d * d.sqrt());
    let found = json(&identify(folder.path(), &["identify", "thing.csv", "--out", "thing", "--json"]));
    assert_eq!(found["law"], "hertz");
    let parameters = found["parameters"].as_array().unwrap();
    let ids: Vec<&str> = parameters.iter().map(|one| one["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["hertz_n_per_m_1_5", "contact_m"]);
    for (parameter, truth) in parameters.iter().zip([3.0e4, 0.5e-3]) {
        let [value, low, high] = ["value", "low", "high"].map(|key| parameter[key].as_f64().unwrap());
        assert!(low < value && value < high && (value / truth - 1.0).abs() < 0.01, "{parameter}");
    }
    let laws: Vec<&str> =
        found["ladder"].as_array().unwrap().iter().map(|rung| rung["law"].as_str().unwrap()).collect();
    assert_eq!(laws, ["linear", "hertz", "spring", "hunt-crossley", "zener", "hysteresis", "table"]);
    assert!(found["rms_n"].as_f64().unwrap() < 0.005 && found["ladder"][1]["score"].is_f64());
    let written = |name: &str| std::fs::read_to_string(folder.path().join("thing").join(name)).unwrap();
    assert!(
        written("fit.svg").starts_with("<svg") && written("scene.toml").contains("curve = \"curve.csv\"")
    );
    let curve = written("curve.csv");
    assert_eq!(curve.lines().take(2).collect::<Vec<_>>(), ["compression_mm,force_n", "0.000000,0.000000"]);
    let last: Vec<f64> = curve.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((last[0] - 2.5).abs() < 0.05 && (last[1] / (3.0e4 * 2.5e-3_f64.powf(1.5)) - 1.0).abs() < 0.01);
}

/// A stiffness that changes with the direction and a drag: no law of the ladder has both.
#[test]
fn what_is_outside_the_ladder_is_none_of_these() {
    let folder = tempfile::tempdir().unwrap();
    let force_n = |d: f64, v: f64| if v > 0.0 { 900.0 * d } else { 900.0 * d * d / 2.5e-3 };
    table(folder.path(), "time_s,displacement_m,force_n", 1.0, force_n);
    let found = json(&identify(folder.path(), &["identify", "thing.csv", "--out", "thing", "--json"]));
    assert_eq!(
        (&found["law"], found["parameters"].as_array().map(Vec::len)),
        (&Value::from("none of these"), Some(0))
    );
    // Well above the noise of 0.0035 N.
    assert!(found["structure_n"].as_f64().unwrap() > 0.02, "{found}");
    assert!(!folder.path().join("thing/scene.toml").exists());
}

#[test]
fn an_error_is_one_line_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("short.csv"), "displacement_mm,force_n\n0,0\n1,1\n").unwrap();
    std::fs::write(folder.path().join("static.csv"), {
        let rows: String = (0..50).map(|row| format!("{row},{row}\n")).collect();
        format!("displacement_mm,force_n\n{rows}")
    })
    .unwrap();
    for (arguments, says) in [
        (&["identify", "none.csv"][..], "error: none.csv: cannot read the measurement"),
        (&["identify", "short.csv"], "error: short.csv:3: the measurement has 2 samples"),
        (
            &["identify", "static.csv", "--law", "zener"],
            "error: static.csv: the law `zener` depends on the velocity",
        ),
        (&["identify", "short.mcap"], "error: cannot open the recording `short.mcap`"),
    ] {
        let output = identify(folder.path(), arguments);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(told.starts_with(says) && told.lines().count() == 1, "{told}");
        assert!(matches!(output.status.code(), Some(1 | 2)), "{told}");
    }
}
