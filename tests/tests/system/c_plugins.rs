//! Plugins written in C and C++: compiled here from `c/` with the committed header, found by id, run in a scene, and refused
//! in one line where their author made a mistake. The header gives them the contract's layout table, so that
//! an author's old header is found out as an old SDK is.

use flotor_core::trace::Events;
use flotor_hal::Wrench;
use flotor_servo::RunEnd;
use flotor_session::registry::load_file;
use flotor_tests::TestSize;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use flotor_tests::watched::{Watched, watch};
use flotor_tests::workspace_root;
use std::path::PathBuf;
use std::process::Command;

/// Compiles `c/NAME.c` with the mistakes asked for.
fn compiled(scratch: &Scratch, name: &str, mistakes: &[&str]) -> PathBuf {
    let library = scratch.path().join(format!("lib{name}.so"));
    compile_c_file(&workspace_root().join("tests/c").join(name).with_extension("c"), mistakes, &library);
    library
}

/// A scene of 20 ticks with the post and the wall of these files.
fn scene(scratch: &Scratch, mistakes: &[&str]) -> String {
    let (post, wall) = (compiled(scratch, "post", &[]), compiled(scratch, "wall", mistakes));
    format!(
        "duration_s = 0.02\n[device]\nplugin = {post:?}\n[[model]]\nplugin = {wall:?}\nname = \"wall\"\n\
         [model.parameters]\nstiffness_n_per_m = 700\n[limits]\nramp_s = 0\n"
    )
}

#[test]
fn device_and_model_in_c_run_a_scene() {
    let Watched { records, outcome, .. } = watch(&scene(&Scratch::default(), &[]));
    assert_eq!((outcome.end, records.len()), (RunEnd::Finished, 20));
    // A millimetre below home: 0.7 N up, felt from the tick after the first.
    let expected = Wrench { force_n: [0.0, 0.0, 700.0 * 0.001], torque_nm: [0.0; 3] };
    for record in &records {
        assert_eq!(record.model.wrench(), Some(expected));
        assert_eq!((record.commanded, record.events), (expected, Events::NONE));
        assert_eq!(record.delivered, if record.tick == 0 { Wrench::ZERO } else { expected });
    }
}

#[test]
fn a_fault_is_no_cycle_for_a_compiler_and_an_unknown_cycle_is_named() {
    let scratch = Scratch::default();
    let fault = std::panic::catch_unwind(|| {
        compiled(&Scratch::default(), "post", &["RESULT=FlotorFault_Disconnected"])
    });
    assert!(fault.is_err(), "it compiles");
    let post = compiled(&scratch, "post", &["RESULT=flotor_cycle(5u)"]);
    let scene = scratch.file("scene.toml", format!("duration_s = 1\n[device]\nplugin = {post:?}\n"));
    let ran = Flotor::with(["run", &scene.display().to_string(), "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
    let named = "`read` returned 5, which is not a cycle; return a fault as FLOTOR_CYCLE_FAULT(5)";
    assert!(ran.stderr.contains(named), "{ran:#?}");
}

/// A device of another maker rounds its orientation to six decimals or to single precision: its models must not answer zero.
#[test]
fn an_orientation_that_the_host_accepts_has_the_force_of_one_of_length_one() {
    let scratch = Scratch::default();
    let run_with = |length: &str| {
        let post = compiled(&scratch, "post", &[&format!("ORIENTATION_W={length}")]);
        watch(&format!(
            "duration_s = 0.05\n[device]\nplugin = {post:?}\n[[model]]\nplugin = \"spring\"\n[limits]\nramp_s = 0\n"
        ))
    };
    let peak_n = |run: &Watched| run.records.iter().fold(0.0_f64, |peak, r| peak.max(r.commanded.force_n[2]));
    let exact = run_with("1.0");
    let expected_n = peak_n(&exact);
    // Spring 1 has 679 N/m at home; a millimetre of compression adds less than a percent.
    assert!((expected_n - 0.679).abs() < 0.01, "{expected_n} N");
    for length in ["0.9991", "0.99999", "1.000001", "1.00001", "1.0009"] {
        let run = run_with(length);
        assert_eq!(run.records.len(), exact.records.len());
        assert!(
            run.records.iter().all(|record| !record.events.intersects(Events::MODEL_DEGRADED)),
            "length {length}"
        );
        // Normalisation rounds.
        assert!((peak_n(&run) - expected_n).abs() < 1.0e-12, "length {length}: {} N", peak_n(&run));
    }
    let refused = run_with("1.0011");
    assert_eq!(peak_n(&refused), 0.0);
    assert!(refused.records.iter().all(|record| record.events.intersects(Events::IMPLAUSIBLE_SAMPLE)));
}

/// A recording knows a plugin by its id, not by where its file was: that is another place tomorrow.
#[test]
fn a_recording_of_plugins_named_by_their_files_replays_where_their_folder_is_told() {
    let scratch = Scratch::default();
    let file = scratch.file("scene.toml", scene(&scratch, &[])).display().to_string();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let ran = Flotor::with(["run", &file, "--clock", "virtual", "--record", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let lost = Flotor::with(["replay", &recording]).run();
    assert_eq!(lost.code, Some(exit_code::CONFIGURATION), "{lost:#?}");
    assert!(lost.error().contains("no model plugin `fixture-c-wall`"), "{lost:#?}");
    assert!(lost.error().contains("FLOTOR_PLUGIN_PATH adds folders"), "{lost:#?}");
    let folder = scratch.path().display().to_string();
    let found = Flotor::with(["replay", &recording, "--plugin-path", &folder]).run();
    assert_eq!(found.code, Some(exit_code::OK), "{found:#?}");
    assert!(found.stdout.contains("bit for bit the recorded outputs"), "{found:#?}");
}

#[test]
fn plugins_in_c_pass_validation_and_are_found_by_id() {
    let scratch = Scratch::default();
    for (name, id) in [("wall", "fixture-c-wall"), ("post", "fixture-c-post")] {
        let library = compiled(&scratch, name, &[]);
        let plugin = load_file(&library).unwrap_or_else(|error| panic!("{error}"));
        assert!(
            !plugin.layouts_proven(),
            "C carries the contract's layout table, and no proof by abi_stable"
        );
        let ran = Flotor::with(["validate".as_ref(), library.as_os_str()]).run();
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
        let ran = Flotor::with(["plugins", id]).searching(&[scratch.path()]).run();
        assert!(ran.stdout.contains("layouts compared"), "{ran:#?}");
    }
}

/// The same contract in C++: tables made by functions, and an entry with the linkage of C.
#[test]
fn a_plugin_in_cpp_passes_validation() {
    if !required(Tool::Cxx) {
        return;
    }
    let scratch = Scratch::default();
    let library = scratch.path().join("libjelly.so");
    let compiled = Command::new("c++")
        .args(["-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC", "-I"])
        .arg(workspace_root().join("hal/include"))
        .arg(workspace_root().join("examples/model-cpp/jelly.cpp"))
        .arg("-o")
        .arg(&library)
        .output()
        .expect("it was there just now");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let ran = Flotor::with(["validate".as_ref(), library.as_os_str()]).run();
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
}

#[test]
fn a_mistake_in_c_is_told_in_one_line() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let wrong = [
        (
            "WITHOUT_STEP",
            "the table `flotor.force/1` has no `step`; use the export macros or the current header",
        ),
        ("WITHOUT_TABLE", "the table `flotor.force/1` is missing; use the export macros"),
        ("SHORT_TABLE", "the table `flotor.force/1` is shorter than in the contract; use the export macros"),
        ("MISALIGNED_TABLE", "the table `flotor.force/1` is not aligned; use the export macros"),
        (
            "SHORT_EXTENSION",
            "the table `flotor.active-region/1` is shorter than in the contract; use the export macros",
        ),
        ("OTHER_KIND", "the metadata have the kind model, the entry's `kind` is 2 (device); make both equal"),
        ("ODD_KIND", "the metadata have the kind model, the entry's `kind` is 7 (unknown); make both equal"),
        (
            "WITHOUT_LAYOUTS",
            "the plugin has no valid layout table; rebuild the plugin against this host's flotor-hal",
        ),
        (
            "OTHER_CANDIDATE",
            "built for plugin contract 1.0, but this host has contract 1.0-rc; rebuild the plugin",
        ),
        ("SHORT_ENTRY", "no plugin entry `flotor_entry_wall` in the library"),
        (
            "HIDDEN_ENTRY",
            "no plugin entry `flotor_entry_wall` in the library; export the entry with default visibility",
        ),
    ];
    for (mistake, cause) in wrong {
        let scratch = Scratch::default();
        let file = scratch.file("scene.toml", scene(&scratch, &[mistake]));
        let ran =
            Flotor::with(["run".as_ref(), file.as_os_str(), "--clock".as_ref(), "virtual".as_ref()]).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{mistake}: {ran:#?}");
        let library = scratch.path().join("libwall.so");
        assert!(ran.error().starts_with(&format!("{}: ", library.display())), "{mistake}: {ran:#?}");
        assert!(ran.error().contains(cause), "{mistake}: {ran:#?}");
    }
}

/// A status outside the contract may mean anything, so the force beside it counts for nothing.
#[test]
fn an_answer_outside_the_contract_is_no_force() {
    let Watched { records, outcome, .. } = watch(&scene(&Scratch::default(), &["ODD_ANSWERS"]));
    assert!(records.iter().all(|record| record.commanded == Wrench::ZERO));
    assert!(records.iter().all(|record| record.events.intersects(Events::MODEL_FAULT)));
    assert_eq!(outcome.models[0].1.rejected.ticks, 20);
}
