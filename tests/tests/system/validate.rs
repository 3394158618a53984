//! `flotor validate` finds every mistake of `c/bad/`, under the rule that is about it, and none in what is
//! right. What a plugin prints, and however much, is in nobody's way: neither here nor in a run that keeps a
//! model in a process.

use flotor_tests::library::{compile_c_file, plugin_file};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, crate_name_of, plugin_folders, workspace_root};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Compiles `c/bad/NAME.c` with the mistakes asked for.
fn compiled(scratch: &Scratch, name: &str, mistakes: &[&str]) -> PathBuf {
    let library = scratch.path().join(format!("lib{name}.so"));
    let source = workspace_root().join("tests/c/bad").join(name).with_extension("c");
    compile_c_file(&source, mistakes, &library);
    library
}

/// What is found about a plugin, but for the time budget: how long a step takes here and now says nothing.
fn findings(library: &Path) -> Vec<Value> {
    let arguments = ["validate".as_ref(), library.as_os_str(), "--json".as_ref()];
    let ran = Flotor::with(arguments).run();
    let mut all: Vec<Value> = serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{ran:#?}"));
    all.retain(|finding| finding["rule"] != "time-budget");
    all
}

fn assert_found(name: &str, mistake: &str, rule: &str, words: &str) {
    let all = findings(&compiled(&Scratch::default(), name, &[mistake]));
    let found = all.iter().find(|finding| finding["rule"] == rule);
    let found = found.unwrap_or_else(|| panic!("{mistake}: {rule} was not checked: {all:#?}"));
    assert_ne!(found["obstacle"], "subject", "{mistake}: {rule} has nothing to judge: {all:#?}");
    if let Some(reason) = found["unchecked"].as_str() {
        println!("{mistake}: {rule} cannot be checked here: {reason}");
        return;
    }
    let violation = found["violation"].as_str().unwrap_or_default();
    assert!(violation.contains(words), "{mistake} under {rule}: {all:#?}");
}

fn assert_nothing_found(library: &Path) {
    let all = findings(library);
    let violated: Vec<&Value> = all.iter().filter(|finding| !finding["violation"].is_null()).collect();
    assert!(violated.is_empty() && all.len() > 5, "{}: {all:#?}", library.display());
}

#[test]
fn every_mistake_of_a_model_is_found_under_its_rule() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let mistakes = [
        ("CHOICES_WITHOUT_END", "loads", "1125899906842624 choices"),
        ("PARAMETERS_WITHOUT_END", "loads", "1000000 parameters"),
        ("PARAMETERS_NOWHERE", "loads", "1 parameters at a null pointer"),
        ("TEXT_OF_BYTES", "loads", "not UTF-8"),
        ("TEXT_WITHOUT_END", "loads", "1125899906842624 bytes"),
        ("TEXT_NOWHERE", "schema", "has no doc; describe the parameter"),
        (
            "OTHER_ID",
            "loads",
            "the id `fixture-c-other-model`, but its metadata have the id `fixture-c-bad-model`",
        ),
        ("NAN_IN_MOTION", "finite-in-motion", "NaN"),
        ("NAN_IN_MOTION", "live-parameters", "NaN"),
        ("CRASHES_IN_MOTION", "finite-in-motion", "by signal 11"),
        ("INTEGRATES", "reset-repeats", "another result after reset"),
        ("SAVES_NOTHING", "restore-repeats", "after a restore, another instance returned another wrench"),
        ("FORCE_BY_DEMAND", "demand", "with force alone"),
        ("LIVE_WITHOUT_SETTER", "live-parameters", "`set_parameter` returned `unsupported`"),
        ("ABORTS_WHEN_SET", "live-parameters", "by signal 6"),
        ("REFUSES_WHEN_SET", "live-parameters", "rejects every live parameter"),
        ("FORGETS_WHAT_IS_SET", "live-parameters", "is 500 instead of 0"),
        ("ACTS_OUTSIDE", "activity", "outside its active region"),
        ("NEGATIVE_DAMPING", "passive", "damping must dissipate"),
        ("WHIRLS", "passive", "once round a circle in x and y"),
        ("ALLOCATES", "no-system-calls", "a step allocated memory or made another system call"),
        ("OPENS_FILES", "no-system-calls", "a step allocated memory or made another system call"),
        ("STARTS_THREADS", "no-system-calls", "a step allocated memory or made another system call"),
        ("WRITES", "no-system-calls", "read or write system calls"),
    ];
    for (mistake, rule, words) in mistakes {
        // Not every kernel counts what a thread writes.
        if mistake == "WRITES" && !Path::new("/proc/self/io").exists() {
            continue;
        }
        assert_found("model", mistake, rule, words);
    }
}

#[test]
fn every_mistake_of_a_device_is_found_under_its_rule() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let mistakes = [
        ("RATES_REVERSED", "capabilities", "10000 to 100 Hz"),
        ("RATES_WITHOUT_END", "capabilities", "100 to inf Hz"),
        ("NAN_STIFFNESS", "capabilities", "max_stiffness_n_per_m"),
        ("NAN_LATENCY", "capabilities", "latency_s"),
        ("NEGATIVE_RESOLUTION", "capabilities", "resolution_m"),
        ("NO_RANGE", "capabilities", "`range_m` is [0, 0, 0]: x is driven, so declare its range of motion"),
        ("ENDLESS_RANGE", "capabilities", "`range_rad` is [0.1, inf, 0.1]: must be 0 to 1000 rad"),
        ("ENDLESS_FORCE", "capabilities", "`max_force_n` is [10, 10, inf]: must be 0 to 100000 N"),
        ("ABSURD_FORCE", "capabilities", "`max_force_n` is [1e308, 10, 10]: must be 0 to 100000 N"),
        (
            "NO_FORCE",
            "capabilities",
            "`max_force_n` is [10, 0, 10]: y is driven, so declare its largest force",
        ),
        (
            "NO_TORQUE",
            "capabilities",
            "`max_torque_nm` is [0, 0, 0]: the rotation about x is driven, so declare its largest torque",
        ),
        ("NEGATIVE_TORQUE", "capabilities", "`max_torque_nm` is [0.5, 0.5, -1]: must be 0 to 100000 N·m"),
        ("NO_SLEW", "capabilities", "`max_force_slew_n_per_s` is 0: the force could never change"),
        ("ENDLESS_SLEW", "capabilities", "`max_torque_slew_nm_per_s` is inf: must be 0 to"),
        ("ENDLESS_STIFFNESS", "capabilities", "`max_stiffness_n_per_m` is inf: must be 0 to"),
        ("SEVEN_AXES", "capabilities", "`sensed` is 0b1111111: there are six axes"),
        ("EVERY_AXIS", "capabilities", "`actuated` is 0b11111111111111111111111111111111: there are six"),
        ("CHANGES_ITS_MIND=0", "capabilities", "capabilities changed between two calls"),
        ("STALE", "lifecycle", "no fresh sample within"),
        ("NO_QUATERNION", "lifecycle", "the quaternion has length 0"),
        ("NAN_DELIVERED", "lifecycle", "NaN"),
        ("FAULTS_AFTER_STOP", "safe-stop", "after safe_stop, read at tick"),
        ("SILENT_AFTER_STOP", "safe-stop", "the device has delivered only 0 of 20 samples"),
        ("IGNORES_STOP", "safe-stop", "the device still delivers"),
        ("IGNORES_STOP_IN_SILENCE", "safe-stop", "its stop cannot be checked"),
    ];
    // Side by side: a device is checked in real time.
    mistakes.par_iter().for_each(|(mistake, rule, words)| assert_found("device", mistake, rule, words));
}

/// What no host can enforce does not get as far as a loop: the line names file, device, field and what to mend.
#[test]
fn a_run_refuses_a_device_whose_capabilities_cannot_be_enforced() {
    let mistakes = [
        ("NO_RANGE", "`range_m` is [0, 0, 0]: x is driven, so declare its range of motion"),
        ("ENDLESS_RANGE", "`range_rad` is [0.1, inf, 0.1]: must be 0 to 1000 rad on each axis"),
        ("ENDLESS_FORCE", "`max_force_n` is [10, 10, inf]: must be 0 to 100000 N on each axis"),
        (
            "NO_TORQUE",
            "`max_torque_nm` is [0, 0, 0]: the rotation about x is driven, so declare its largest torque",
        ),
        ("ENDLESS_SLEW", "`max_torque_slew_nm_per_s` is inf: must be 0 to"),
        ("RATES_REVERSED", "`rate_hz` is 10000 to 100 Hz: declare the slowest rate first"),
        ("NAN_LATENCY", "`latency_s` is NaN: must be 0 to 10 s"),
        ("SEVEN_AXES", "`sensed` is 0b1111111: there are six axes; clear the bits above the sixth"),
        ("CHANGES_ITS_MIND=0", "the capabilities changed between two calls"),
    ];
    let run = |library: &Path| {
        let scratch = Scratch::default();
        let scene = format!("duration_s = 0.1\n[device]\nplugin = {library:?}\n");
        let file = scratch.file("scene.toml", scene).display().to_string();
        Flotor::with(["run", &file, "--clock", "virtual"]).run()
    };
    let scratch = Scratch::default();
    let good = run(&compiled(&scratch, "device", &[]));
    assert_eq!(good.code, Some(exit_code::OK), "the control: {good:#?}");
    mistakes.par_iter().for_each(|(mistake, words)| {
        let scratch = Scratch::default();
        let library = compiled(&scratch, "device", &[mistake]);
        let ran = run(&library);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{mistake}: {ran:#?}");
        let device = format!("{}: `fixture-c-bad-device` refused: ", library.display());
        assert!(ran.error().starts_with(&device) && ran.error().contains(words), "{mistake}: {ran:#?}");
    });
}

#[test]
fn what_is_right_passes() {
    let right = [
        ("model", "NONE"),
        ("model", "DAMPING"),
        ("model", "INTEGRATES_AND_RESETS"),
        ("model", "SAVES"),
        ("model", "LOCAL"),
        ("model", "PRINTS"),
        ("device", "NONE"),
        ("device", "STOPS_AS_EMERGENCY"),
    ];
    for (name, macro_name) in right {
        assert_nothing_found(&compiled(&Scratch::default(), name, &[macro_name]));
    }
}

/// The models that `host/scenes/NAME.test.toml` validates with each daily check.
const TESTED: [&str; 2] = ["flotor-spring", "flotor-wall"];

/// Every rule, times included: at full size a hundred times each, eight at a time, which are each other's load.
#[test]
fn no_shipped_plugin_is_accused() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let size = TestSize::of_this_run();
    let left_out = &TESTED[..size.pick(TESTED.len(), 0)];
    let names = plugin_folders().into_iter().map(|folder| crate_name_of(&folder));
    let plugins =
        names.filter(|name| !left_out.contains(&name.as_str())).map(|name| (plugin_file(&name), Vec::new()));
    let full = (plugin_file("flotor-simulated"), vec!["--set", "preset=full"]);
    let all: Vec<_> = plugins.chain([full]).collect();
    let runs = (0..size.pick(1, 100)).flat_map(|_| &all).collect::<Vec<_>>();
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(size.pick(1, 8)).build().expect("threads can be started");
    pool.install(|| {
        runs.par_iter().for_each(|(library, settings)| {
            // Creating the solid is ten seconds of work without optimisation, and of waiting on a loaded machine.
            let limit = ["--timeout", "120s", "--json"].map(AsRef::as_ref);
            let arguments = ["validate".as_ref(), library.as_os_str()].into_iter().chain(limit);
            let ran = Flotor::with(arguments.chain(settings.iter().map(AsRef::as_ref))).run();
            assert_eq!(ran.code, Some(exit_code::OK), "{}: {ran:#?}", library.display());
            // What needs hardware that is not here says so; everything else is checked.
            let findings: Vec<Value> = serde_json::from_str(&ran.stdout).expect("the findings are JSON");
            let checked = findings.iter().filter(|finding| finding["unchecked"].is_null()).count();
            assert!(findings.len() >= 7 && checked >= 3, "{}: {ran:?}", library.display());
        });
    });
}

/// A rule that has looked at nothing says neither that it holds nor that it does not.
#[test]
fn a_rule_with_nothing_to_judge_is_not_ok() {
    for (name, rule, why) in [
        ("flotor-measured", "activity", "the model is active everywhere"),
        ("flotor-membrane", "passive", "the model has a history"),
        ("flotor-membrane", "energy-gradient", "the model has a history"),
    ] {
        let library = plugin_file(name);
        let arguments = ["validate".as_ref(), library.as_os_str(), "--only".as_ref(), rule.as_ref()];
        let ran = Flotor::with(arguments).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
        assert!(ran.stdout.contains(&format!("-       {rule}")), "{ran:#?}");
        assert!(ran.stdout.contains(&format!("not judged: {why}")), "{ran:#?}");
        assert!(!ran.stdout.contains("could not be checked"), "{ran:#?}");
    }
    let library = plugin_file("flotor-measured");
    let arguments = ["validate".as_ref(), library.as_os_str(), "--only".as_ref(), "passive".as_ref()];
    let ran = Flotor::with(arguments).run();
    assert!(ran.stdout.contains("ok      passive"), "the rule looks at a model without a history: {ran:#?}");
}

#[test]
fn a_file_that_is_not_there_is_told_as_such() {
    let ran = Flotor::with(["validate", "none.so"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().contains("no plugin `none.so`"), "{ran:#?}");
}

#[test]
fn a_model_that_gives_its_energy_back_with_interest_is_found_in_rust_too() {
    let library = plugin_file("fixture-faulty-model");
    let arguments = ["validate".as_ref(), library.as_os_str()];
    let ran = Flotor::with(arguments).env(fixture_faulty_model::FAULT_VARIABLE, "pumps").run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    assert!(ran.stdout.contains("FAILED  passive"), "{ran:#?}");
}

#[test]
fn stiffness_and_damping_near_home_are_told() {
    let all = findings(&compiled(&Scratch::default(), "model", &["DAMPING"]));
    let passive = all.iter().find(|finding| finding["rule"] == "passive").expect("it is checked");
    let told = |name: &str| passive["figures"][name].as_f64().unwrap_or(f64::NAN);
    // 500 N/m and 5 N s/m, but for rounding in differences of a hundredth of a millimetre.
    assert!((told("stiffness_n_per_m") - 500.0).abs() < 1.0e-6, "{passive:#?}");
    assert!((told("damping_ns_per_m") - 5.0).abs() < 1.0e-6, "{passive:#?}");
}

#[test]
fn a_model_in_a_process_of_its_own_may_print_whatever_it_likes() {
    let scratch = Scratch::default();
    let (device, model) = (compiled(&scratch, "device", &[]), compiled(&scratch, "model", &["PRINTS"]));
    let scene = format!(
        "duration_s = 0.02\n[device]\nplugin = {device:?}\n[[model]]\nplugin = {model:?}\nname = \"spring\"\n\
         isolation = \"process\"\n"
    );
    let file = scratch.file("scene.toml", scene).display().to_string();
    let ran = Flotor::with(["run", &file, "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stderr.contains("a model that says a lot"), "{ran:#?}");
    assert!(!ran.stdout.contains("a model that says a lot"), "{ran:#?}");
}
