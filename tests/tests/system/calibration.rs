//! Calibrating the simulated flotor through the command line: the error falls, files are checked, nothing depends on
//! luck.

use flotor_session::registry::load_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, library::plugin_file};
use serde_json::Value;
use std::path::Path;

fn run(arguments: &[&str]) -> Value {
    let ran = Flotor::with(arguments.iter().copied().chain(["--json", "-"])).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    serde_json::from_str(&ran.stdout).expect("the summary is JSON")
}

fn number(report: &Value, key: &str) -> f64 {
    report[key].as_f64().unwrap_or_else(|| panic!("{key} is a number in {report}"))
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a scratch folder has a plain name")
}

#[test]
fn the_error_falls_below_half_a_percent_with_every_seed() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for seed in 1..=TestSize::of_this_run().pick(3, 100) {
        let report = run(&["calibrate", "vertical", "--simulated", "--seed", &seed.to_string()]);
        // The field's own error, over heights the rig meets to 2 µm: 0.01 % at the steep end.
        assert!((number(&report, "error_before_percent") - 10.87).abs() < 0.03, "{report}");
        assert!(number(&report, "error_after_percent") <= 0.5, "{report}");
        // A correction cannot be better than its own confidence by luck alone for all seeds, nor much worse for any.
        assert!(
            number(&report, "error_after_percent") < 5.0 * number(&report, "band_95_percent"),
            "the band says what to expect: {report}"
        );
        assert!(
            (number(&report, "weight_n") - 8.58).abs() < 2.5 * number(&report, "weight_95_n"),
            "{report}"
        );
        let rows = report["rows"].as_array().expect("the baselines stand in the same table");
        let errors: Vec<f64> = rows.iter().map(|row| number(row, "error_percent")).collect();
        assert_eq!(errors.len(), 4);
        assert!(errors.is_sorted_by(|better, worse| better >= worse), "{errors:?}");
    }
}

#[test]
fn equal_seeds_give_equal_results_and_other_seeds_do_not() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let report = |seed| run(&["calibrate", "vertical", "--simulated", "--seed", seed]).to_string();
    assert_eq!(report("5"), report("5"));
    assert_ne!(report("5"), report("6"));
}

#[test]
fn a_written_file_is_read_and_does_what_it_said() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let (file, picture) = (scratch.path().join("c.toml"), scratch.path().join("c.svg"));
    let report =
        run(&["calibrate", "vertical", "--simulated", "--out", text(&file), "--plot", text(&picture)]);
    let verified = run(&["calibrate", "verify", text(&file), "--simulated", "--seed", "99"]);
    for key in ["error_before_percent", "error_after_percent"] {
        // Another seed, other noise of the pose: micrometres, in a field of 2 % per millimetre.
        assert!((number(&report, key) - number(&verified, key)).abs() < 0.02, "{report} {verified}");
    }
    let picture = std::fs::read_to_string(&picture).expect("the picture was drawn");
    assert!(picture.starts_with("<svg") && picture.contains("Residual"));
}

#[test]
fn a_scene_names_the_file_and_the_device_corrects_the_total_force() {
    let scratch = Scratch::default();
    let file = scratch.path().join("thesis.toml");
    let ran = Flotor::with(["calibrate", "import", "--out", text(&file)]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let run = |device: &str| {
        let scene = format!(
            "duration_s = 1\n[device]\nplugin = \"simulated\"\n{device}\n[device.parameters]\npreset = \"full\"\n\
             [[model]]\nplugin = \"spring\"\n"
        );
        let scene = scratch.file("scene.toml", scene);
        Flotor::with(["run", text(&scene), "--clock", "virtual", "--json", "-"]).run()
    };
    let summary = |device: &str| {
        let ran = run(device);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
        serde_json::from_str::<Value>(&ran.stdout).expect("the summary is JSON")["trace_digest"].clone()
    };
    // Relative to the scene, not to where the command runs.
    assert_ne!(summary("calibration = \"thesis.toml\""), summary(""), "another force, another motion");
    let other = scratch.path().join("other.toml");
    let ran = Flotor::with(["calibrate", "import", "--serial", "7", "--out", text(&other)]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    for (name, words) in
        [("other.toml", "calibrate this device"), ("missing.toml", "cannot read the calibration")]
    {
        let ran = run(&format!("calibration = \"{name}\""));
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains("scene.toml:4") && ran.error().contains(words), "{}", ran.error());
    }
}

#[test]
fn the_polynomial_of_the_thesis_can_be_imported_and_leaves_what_it_leaves() {
    let scratch = Scratch::default();
    let file = scratch.path().join("thesis.toml");
    let ran = Flotor::with(["calibrate", "import", "--out", text(&file)]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let verified = run(&["calibrate", "verify", text(&file), "--simulated"]);
    // On the total command at 10 N: between the field's 10.87 % and the polynomial's own 4.39 %.
    let after = number(&verified, "error_after_percent");
    assert!((10.87 - 4.39 - after).abs() < 0.3, "{after}");
}

#[test]
fn what_cannot_be_is_refused_in_one_line() {
    let scratch = Scratch::default();
    let other = scratch.path().join("other.toml");
    let ran =
        Flotor::with(["calibrate", "import", "--device", "maglev", "--serial", "7", "--out", text(&other)])
            .run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let broken = scratch.file("broken.toml", "format = 1\n[device]\nplugin = 3\n");
    let missing = scratch.path().join("missing.toml");
    let head = "format = 1\n[device]\nplugin = \"simulated\"\n[vertical]\n";
    let tail = "[provenance]\nsource = \"imported\"\nprogram = \"x\"\n";
    let far = format!("{head}range_mm = [-1e300, 7]\ncoefficients_per_mm = [1]\n{tail}");
    let steep = format!("{head}range_mm = [-7, 7]\ncoefficients_per_mm = [1, 1e300]\n{tail}");
    let [far, steep] =
        [("far.toml", far), ("steep.toml", steep)].map(|(name, text)| scratch.file(name, text));
    for (file, words) in [
        (&other, "`maglev` 7"),
        (&broken, "broken.toml:3"),
        (&missing, "cannot read"),
        (&far, "far.toml:5: [vertical] the range -1e300 mm"),
        (&steep, "steep.toml:6: [vertical] "),
    ] {
        let ran = Flotor::with(["calibrate", "verify", text(file), "--simulated"]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains(words), "{}", ran.error());
    }
    let one_force = Flotor::with(["calibrate", "vertical", "--simulated", "--force", "10"]).run();
    assert_eq!(one_force.code, Some(exit_code::CONFIGURATION), "{one_force:#?}");
    assert!(
        one_force.error().contains("--force 10: give at least two different forces"),
        "{}",
        one_force.error()
    );
    let far = Flotor::with(["calibrate", "vertical", "--simulated", "--steps", "30"]).run();
    assert_eq!(far.code, Some(exit_code::CONFIGURATION), "{far:#?}");
    assert!(far.error().contains("at most 22 mm in all"), "{}", far.error());
}

#[test]
fn the_extension_checks_what_it_is_given() {
    use flotor_hal::VerticalCalibration;
    use flotor_loader::Setting;
    let plugin = load_file(&plugin_file("flotor-simulated")).expect("the simulated flotor loads");
    let full = [Setting::parse(plugin.parameters(), "preset", "full").expect("the preset exists")];
    let mut device = plugin.open_device(&full).expect("it opens");
    assert_eq!(device.serial(), "simulated");
    device.calibrate_vertical(&VerticalCalibration::NONE).expect("the uneven field can be calibrated");
    let mut plain = plugin.open_device(&[]).expect("it opens");
    let refused = plain.calibrate_vertical(&VerticalCalibration::NONE).unwrap_err();
    assert!(refused.reason.contains("nothing to calibrate"), "{refused}");
}
