//! Every wrong plugin costs one readable line that names file, cause and remedy, and the right exit code; never
//! the process.
//!
//! What is wrong with the file is met by three ways into the host: the loader, `flotor validate` and
//! `flotor run`. What goes wrong later, in a call, is met by a run: on the virtual clock through the library, to
//! look at every tick, and through the program, to look at the line and the exit code. A line on standard error
//! is compared whole, so that no backtrace and no panic message of a plugin slips through.

use flotor_core::health::ModelHealth;
use flotor_core::trace::Events;
use flotor_hal::abi::{ABI_MAJOR, ABI_MINOR, CallStatus, MAGIC};
use flotor_hal::{Input, Output, Pose, Wrench};
use flotor_loader::{LoadError, Setting, read_metadata};
use flotor_servo::RunEnd;
use flotor_session::Outcome;
use flotor_session::registry::load_file;
use flotor_tests::TestSize;
use flotor_tests::library::{compile_c, compile_c_file, patched, plugin_bytes, plugin_file};
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use flotor_tests::workspace_root;
use std::path::{Path, PathBuf};

const MODEL: &str = "fixture-faulty-model";
const DEVICE: &str = "fixture-faulty-device";

// ---------------------------------------------------------------- files that are no plugin of this contract

/// A file that must be refused, what the line must say, and what it must advise.
struct WrongFile {
    name: &'static str,
    make: fn(&Scratch) -> PathBuf,
    cause: &'static str,
    remedy: &'static str,
}

const WRONG_FILES: &[WrongFile] = &[
    WrongFile {
        name: "a text file",
        make: |scratch| scratch.file("text.so", "I am no library.\n"),
        cause: "not a shared library",
        remedy: "name the library of a plugin, or build this library again",
    },
    WrongFile {
        name: "an empty file",
        make: |scratch| scratch.file("empty.so", ""),
        cause: "not a shared library",
        remedy: "name the library of a plugin, or build this library again",
    },
    WrongFile {
        name: "half a plugin",
        make: |scratch| {
            let bytes = plugin_bytes("flotor-spring");
            scratch.file("half.so", &bytes[..bytes.len() / 2])
        },
        cause: "the file is truncated",
        remedy: "copy or build the plugin again",
    },
    WrongFile {
        name: "a C library without an entry",
        make: |scratch| {
            let library = scratch.path().join("stranger.so");
            compile_c("int answer(void);\nint answer(void) { return 42; }\n", &library);
            library
        },
        cause: "a shared library, but not a Flotor plugin (no `.flotor` section)",
        remedy: "FLOTOR_METADATA",
    },
    WrongFile {
        name: "a C library that lacks another one",
        make: |scratch| {
            let library = scratch.path().join("lacking.so");
            let source = format!(
                "{METADATA_IN_C}int not_to_be_found(void);\n\
                 int flotor_entry_wall(void);\nint flotor_entry_wall(void) {{ return not_to_be_found(); }}\n"
            );
            compile_c(&source, &library);
            library
        },
        cause: "undefined symbol: not_to_be_found",
        remedy: "link the library that has the symbol, and rebuild the plugin",
    },
    WrongFile {
        name: "metadata that are no TOML",
        make: |scratch| {
            let bytes = patched(plugin_bytes(MODEL), b"kind = \"model\"", b"kind : \"model\"");
            scratch.file("yaml.so", bytes)
        },
        cause: "unreadable plugin metadata",
        remedy: "build the plugin with the export macros or the current header",
    },
    WrongFile {
        name: "a kind nobody knows",
        make: |scratch| {
            let bytes = patched(plugin_bytes(MODEL), b"kind = \"model\"", b"kind = \"muddl\"");
            scratch.file("muddl.so", bytes)
        },
        cause: "kind `muddl` is neither model nor device",
        remedy: "build the plugin with the export macros or the current header",
    },
    WrongFile {
        name: "another contract, said by the metadata",
        make: |scratch| {
            let bytes = patched(plugin_bytes(MODEL), b"abi = \"1.0-rc\"", b"abi = \"9.0-rc\"");
            scratch.file("other_contract.so", bytes)
        },
        cause: "built for plugin contract 9.0-rc, but this host has contract 1.0-rc",
        remedy: "rebuild the plugin against this version",
    },
    WrongFile {
        name: "a plugin of the contract that was frozen before its candidate",
        make: |scratch| {
            let library = scratch.path().join("frozen.so");
            compile_c(&METADATA_IN_C.replace("1.0-rc", "1.0"), &library);
            library
        },
        cause: "built for plugin contract 1.0, but this host has contract 1.0-rc",
        remedy: "rebuild the plugin against this version",
    },
    WrongFile {
        name: "another contract, said by the entry alone",
        make: |scratch| {
            let bytes = patched(plugin_bytes(MODEL), &entry_head(ABI_MAJOR), &entry_head(ABI_MAJOR + 8));
            scratch.file("other_entry.so", bytes)
        },
        cause: "built for plugin contract 9.0-rc, but this host has contract 1.0-rc",
        remedy: "rebuild the plugin against this version",
    },
    WrongFile {
        name: "an entry that is none",
        make: |scratch| {
            let mut head = entry_head(ABI_MAJOR);
            head[0] ^= 0xff;
            let bytes = patched(plugin_bytes(MODEL), &entry_head(ABI_MAJOR), &head);
            scratch.file("no_magic.so", bytes)
        },
        cause: "no plugin entry `flotor_entry_fixture_faulty_model`",
        remedy: "export the entry with default visibility",
    },
    WrongFile {
        name: "an entry that is not exported",
        make: |scratch| {
            let named = b"entry = \"flotor_entry_fixture_faulty_model\"";
            let absent = b"entry = \"flotor_entry_fixture_absent_model\"";
            scratch.file("no_entry.so", patched(plugin_bytes(MODEL), named, absent))
        },
        cause: "no plugin entry `flotor_entry_fixture_absent_model`",
        remedy: "export the entry with default visibility",
    },
    WrongFile {
        name: "a struct with two fields exchanged",
        make: |scratch| {
            let header =
                std::fs::read_to_string(workspace_root().join("hal/include/flotor.h")).expect("a header");
            let (before, input) = header.split_once("typedef struct FlotorInput {").expect("it is there");
            let (input, after) = input.split_once("} FlotorInput;").expect("it ends");
            let input =
                input.replace("time_ns;", "TICK;").replace("tick;", "time_ns;").replace("TICK;", "tick;");
            let _ = scratch.file(
                "flotor.h",
                format!("{before}typedef struct FlotorInput {{{input}}} FlotorInput;{after}"),
            );
            let wall = std::fs::read(workspace_root().join("tests/c/wall.c")).expect("a source");
            let library = scratch.path().join("exchanged.so");
            compile_c_file(&scratch.file("wall.c", wall), &[], &library);
            library
        },
        cause: "`Input.time_ns` is at byte 104 (8 bytes) in the host and at byte 120 (8 bytes) in the plugin",
        remedy: "rebuild the plugin against this host's flotor-hal",
    },
];

/// The metadata section of a plugin, written by hand.
const METADATA_IN_C: &str = "__attribute__((section(\".flotor\"), used))\n\
    static const char metadata[] = \"kind = \\\"model\\\"\\nid = \\\"wall\\\"\\nversion = \\\"1.0\\\"\\n\"\n\
    \"abi = \\\"1.0-rc\\\"\\nentry = \\\"flotor_entry_wall\\\"\\n\";\n";

/// The first bytes of an entry: magic, size, contract version.
fn entry_head(abi_major: u16) -> Vec<u8> {
    let size = u32::try_from(size_of::<flotor_hal::abi::Entry>()).expect("a hundred bytes");
    let version = [abi_major.to_ne_bytes(), ABI_MINOR.to_ne_bytes()].concat();
    [&MAGIC[..], &size.to_ne_bytes(), &version].concat()
}

/// Runs a check on every wrong file and says which one it failed on.
fn for_every_wrong_file(check: impl Fn(&WrongFile, &Path)) {
    for wrong in WRONG_FILES {
        eprintln!("{}", wrong.name); // shown if the check fails
        let scratch = Scratch::default();
        check(wrong, &(wrong.make)(&scratch));
    }
}

/// One line that starts with the file and holds cause and remedy.
fn assert_tells(line: &str, file: &Path, wrong: &WrongFile) {
    assert!(line.starts_with(&format!("{}: ", file.display())), "the file is not named: {line}");
    assert!(line.contains(wrong.cause), "the cause is not named: {line}");
    assert!(line.contains(wrong.remedy), "no remedy is named: {line}");
    assert_eq!(line.lines().count(), 1, "{line}");
}

fn refused(file: &Path) -> LoadError {
    match load_file(file) {
        Err(error) => error,
        Ok(plugin) => panic!("{:?} was loaded", plugin.metadata()),
    }
}

#[test]
fn the_loader_refuses_every_wrong_file_in_one_line() {
    for_every_wrong_file(|wrong, file| assert_tells(&refused(file).to_string(), file, wrong));
}

/// abi_stable is the second proof: one that cannot be read proves nothing, and refuses nothing.
#[test]
fn a_proof_by_another_abi_stable_is_no_proof_and_no_refusal() {
    let scratch = Scratch::default();
    let header = |minor: u32| {
        [&b"abi stable library for Rust     "[..], &0_u32.to_ne_bytes(), &minor.to_ne_bytes()].concat()
    };
    let file = scratch.file("other_proof.so", patched(plugin_bytes(MODEL), &header(11), &header(12)));
    let (ours, other) = (load_file(&plugin_file(MODEL)).unwrap(), load_file(&file).unwrap());
    assert_eq!((ours.layouts_proven(), other.layouts_proven()), (true, false));
    other.create_model(&[]).expect("it works as any other");
}

/// An index means a parameter of one schema only.
#[test]
fn a_setting_made_for_another_plugin_is_refused_in_one_line() {
    let (model, spring) =
        (load_file(&plugin_file(MODEL)).unwrap(), load_file(&plugin_file("flotor-spring")).unwrap());
    let setting = Setting::parse(spring.parameters(), "seat", "free").unwrap();
    let Err(refused) = model.create_model(&[setting]) else { panic!("a setting of the spring was taken") };
    let told = "the setting `seat` was created for another plugin; create the setting from the parameters of this plugin";
    assert!(refused.to_string().ends_with(told), "{refused}");
}

/// The plugin is in C and follows every index it gets.
#[test]
fn an_index_that_no_parameter_has_does_not_reach_the_plugin() {
    let scratch = Scratch::default();
    let library = scratch.path().join("libindices.so");
    compile_c_file(&workspace_root().join("tests/c/bad/model.c"), &["FOLLOWS_INDICES"], &library);
    let mut model = load_file(&library).unwrap().create_model(&[]).unwrap();
    for index in [1_usize, 1 << 20, u32::MAX as usize, usize::MAX] {
        assert_eq!(model.set_parameter(index, 1.0), CallStatus::OutOfRange);
        assert!(model.parameter(index).is_nan());
    }
}

#[test]
fn validate_says_what_is_wrong_with_every_file() {
    for_every_wrong_file(|wrong, file| {
        let ran = Flotor::with(["validate".as_ref(), file.as_os_str()]).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        assert!(ran.error().starts_with(&format!("{}: 1 of ", file.display())), "{ran:#?}");
        let violation = ran.stdout.lines().find(|line| line.contains(wrong.cause));
        assert_tells(violation.expect("the violation is told").trim_start(), file, wrong);
    });
}

#[test]
fn a_scene_that_names_a_wrong_file_does_not_run() {
    for_every_wrong_file(|wrong, file| {
        let ran = run_scene(&model_scene(file));
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        assert_tells(ran.error(), file, wrong);
        assert_eq!(ran.stdout, "");
    });
}

#[test]
fn a_plugin_cut_off_anywhere_is_refused_before_any_of_it_is_mapped() {
    let whole = plugin_bytes(MODEL);
    let file = Scratch::default();
    let path = file.file("cut.so", &whole);
    assert!(load_file(&path).is_ok(), "the file is a good one before it is cut");
    // Every page, because that is how a file is mapped; every byte of the headers at both ends.
    let pages = (0..whole.len()).step_by(4096);
    let ends = (0..64).flat_map(|byte| [byte, whole.len() - 1 - byte]);
    let mut lengths: Vec<usize> = pages.chain(ends).filter(|length| *length < whole.len()).collect();
    lengths.sort_unstable();
    let handle = std::fs::OpenOptions::new().write(true).open(&path).expect("a file of ours");
    for length in lengths.into_iter().rev() {
        handle.set_len(length as u64).expect("a file can be cut");
        for error in [refused(&path), read_metadata(&path).expect_err("half a plugin has no metadata")] {
            let refused = matches!(error, LoadError::Truncated { .. } | LoadError::NotALibrary { .. });
            assert!(refused, "cut at {length}: {error}");
        }
    }
}

#[test]
fn a_device_is_no_model_and_a_model_no_device() {
    let (spring, flotor) = (plugin_file("flotor-spring"), plugin_file("flotor-simulated"));
    let wrong = [
        (
            model_scene(&flotor),
            "`simulated` is a device plugin, but a model is needed here; name a model plugin",
        ),
        (
            scene(&spring, &spring, ""),
            "`spring` is a model plugin, but a device is needed here; name a device plugin",
        ),
        (model_scene(Path::new("simulated")), "`simulated` is a device plugin, but a model is needed here"),
    ];
    for (scene, cause) in wrong {
        let ran = run_scene(&scene);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains("scene.toml:") && ran.error().contains(cause), "{ran:#?}");
    }
}

#[test]
fn a_path_without_a_plugin_file_is_a_mistake_in_the_scene_or_command() {
    let scratch = Scratch::default();
    let missing = scratch.path().join("missing.so");
    for (path, cause, verdict) in [
        (missing, "No such file", "does not exist"),
        (scratch.folder("folder.so"), "s a directory", "is not a file"),
    ] {
        let ran = run_scene(&model_scene(&path));
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        let told = format!("scene.toml:5: {}: cannot read the plugin: ", path.display());
        assert!(ran.error().contains(&told) && ran.error().contains(cause), "{ran:#?}");
        let ran = Flotor::with(["validate".as_ref(), path.as_os_str()]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(
            ran.error().ends_with(&format!("{verdict}; `flotor plugins` lists the file of each id")),
            "{ran:#?}"
        );
    }
    let ran = Flotor::with(["eval", "--model", "./missing.so", "--poses", "-"]).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    let _ = scratch.file("bad.so", "I am no library.\n");
    let ran = Flotor::with(["eval", "--model", "bad.so", "--poses", "-"]).inside(scratch.path()).run();
    assert!(ran.error().contains("bad.so: not a shared library"), "{ran:#?}");
}

#[test]
fn a_plugin_nobody_has_is_a_mistake_in_the_scene() {
    let ran = run_scene(&model_scene(Path::new("sprang")));
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    let error = ran.error();
    assert!(error.contains("scene.toml:5: no model plugin `sprang`; did you mean `spring`?"), "{error}");
}

// ---------------------------------------------------------------- plugins that fail in a call

/// A scene of 50 ticks: one device, one model called `model`.
fn scene(device: &Path, model: &Path, parameters: &str) -> String {
    format!(
        "duration_s = 0.05\n[device]\nplugin = {device:?}\n[[model]]\nplugin = {model:?}\nname = \"model\"\n\
         {parameters}\n[limits]\nramp_s = 0\n"
    )
}

/// A model on a healthy device.
fn model_scene(model: &Path) -> String {
    scene(Path::new("simulated"), model, "")
}

/// The faulty model on the faulty device, with parameters of the model.
fn faulty_scene(parameters: &str) -> String {
    scene(&plugin_file(DEVICE), &plugin_file(MODEL), parameters)
}

fn run_scene(scene: &str) -> Ran {
    run_scene_with(scene, &[])
}

fn run_scene_with(scene: &str, sets: &[&str]) -> Ran {
    let scratch = Scratch::default();
    let file = scratch.file("scene.toml", scene);
    let sets = sets.iter().flat_map(|set| ["--set".as_ref(), std::ffi::OsStr::new(*set)]);
    let arguments = ["run".as_ref(), file.as_os_str(), "--clock".as_ref(), "virtual".as_ref()];
    Flotor::with(arguments.into_iter().chain(sets)).run()
}

/// Name, health and last words of the one model of a scene.
fn the_model(outcome: &Outcome) -> &(String, ModelHealth, String) {
    let [model] = &outcome.models[..] else { panic!("one model was named") };
    model
}

/// What the honest model asks for on the faulty device, which rests a millimetre below home: 100 N/m up.
fn honest() -> Wrench {
    Wrench { force_n: [0.0, 0.0, 0.1], torque_nm: [0.0; 3] }
}

#[test]
fn a_model_that_says_no_or_panics_before_the_start_is_a_refused_plugin() {
    let file = plugin_file(MODEL);
    let wrong = [
        ("refuses-to-create", "the table of forces is on another machine"),
        ("panics-in-create", ": create gave up; report this to the author of the plugin"),
        ("panics-in-prepare", ": prepare gave up; report this to the author of the plugin"),
    ];
    for (fault, cause) in wrong {
        let ran = run_scene_with(&model_scene(&file), &[&format!("model.fault={fault}")]);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        let error = ran.error();
        assert!(error.starts_with(&format!("{}: `{MODEL}` refused: ", file.display())), "{error}");
        assert!(error.ends_with(cause), "{error}");
    }
}

#[test]
fn a_panic_names_file_and_line_of_the_plugins_source() {
    let ran = run_scene_with(&model_scene(&plugin_file(MODEL)), &["model.fault=panics-in-create"]);
    assert!(ran.error().contains("panicked at tests/fixtures/faulty-model/src/lib.rs:"), "{ran:#?}");
}

#[test]
fn a_model_that_panics_in_a_step_is_out_and_the_run_goes_on_without_it() {
    let Watched { records, outcome, .. } =
        watch(&faulty_scene("parameters = { fault = \"panics-in-step\", at_tick = 7 }"));
    let (_, health, words) = the_model(&outcome);
    assert_eq!(outcome.end, RunEnd::Finished);
    assert_eq!(records.len(), 50);
    for record in &records {
        let (model, failed) = if record.tick < 7 { (honest(), false) } else { (Wrench::ZERO, true) };
        assert_eq!(record.model.wrench(), Some(model), "tick {}", record.tick);
        assert_eq!(record.events.intersects(Events::MODEL_FAULT), failed, "tick {}", record.tick);
        assert!(record.commanded.is_finite());
    }
    assert_eq!(health.panicked_at, Some(7));
    assert!(words.ends_with("step gave up at tick 7"), "{words}");
}

#[test]
fn a_model_that_panicked_is_reported_in_one_line_with_its_message() {
    let file = plugin_file(MODEL);
    let ran = run_scene_with(&model_scene(&file), &["model.fault=panics-in-step", "model.at_tick=7"]);
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    let error = ran.error();
    let start = format!("{}: `model` panicked at tick 7, no force since: panicked at ", file.display());
    assert!(error.starts_with(&start), "{error}");
    assert!(error.ends_with("step gave up at tick 7; run `flotor validate` for details"), "{error}");
    assert!(ran.stdout.contains("ticks      50   late 0   missed 0"), "the run went on: {ran:#?}");
}

#[test]
fn nan_from_a_model_is_no_force_for_that_tick_alone() {
    let Watched { records, outcome, .. } =
        watch(&faulty_scene("parameters = { fault = \"nan-once\", at_tick = 7 }"));
    let (_, health, _) = the_model(&outcome);
    assert_eq!(outcome.end, RunEnd::Finished);
    for record in &records {
        let (model, failed) = if record.tick == 7 { (Wrench::ZERO, true) } else { (honest(), false) };
        assert_eq!(record.model.wrench(), Some(model), "tick {}", record.tick);
        assert_eq!(record.events.intersects(Events::MODEL_FAULT), failed, "tick {}", record.tick);
    }
    assert_eq!((health.rejected.ticks, health.rejected.first, health.panicked_at), (1, Some(7), None));
}

#[test]
fn nan_from_a_model_is_counted_and_told_in_one_line() {
    let file = plugin_file(MODEL);
    for (fault, count) in [("nan-once", 1), ("nan", 43)] {
        let ran = run_scene_with(&model_scene(&file), &[&format!("model.fault={fault}"), "model.at_tick=7"]);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        let told = format!(
            "{}: `model` {count} results were not finite, the first at tick 7; the host replaced each by zero \
             force; run `flotor validate` for details",
            file.display()
        );
        assert_eq!(ran.error(), told);
    }
}

/// The run is over and was good when the model is freed: there is nobody left to tell, and nothing is lost.
#[test]
fn a_model_that_panics_when_it_is_freed_harms_nobody() {
    let ran = run_scene_with(&model_scene(&plugin_file(MODEL)), &["model.fault=panics-in-drop"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
}

#[test]
fn a_dead_model_never_answers_again() {
    let plugin = load_file(&plugin_file(MODEL)).expect("a good file");
    let setting = |key, value| Setting::parse(plugin.parameters(), key, value).expect("a legal setting");
    let settings = [setting("fault", "panics-in-step"), setting("at_tick", "1")];
    let mut model = plugin.create_model(&settings).expect("it is made");
    let mut step = |tick| {
        let mut output = Output::default();
        let status = model.step(&Input { tick, ..Input::at_rest(Pose::HOME) }, &mut output);
        (status, output.wrench)
    };
    assert_eq!(step(0), (CallStatus::Ok, Wrench::ZERO));
    assert_eq!(step(1).0, CallStatus::Panicked);
    assert_eq!(step(0).0, CallStatus::Panicked, "what it would have answered before it panicked");
}

#[test]
fn a_device_that_fails_before_the_start_is_a_refused_plugin() {
    let file = plugin_file(DEVICE);
    let wrong = [
        ("panics-in-open", ": open gave up; report this to the author of the plugin"),
        ("refuses-to-activate", "the power supply is off; switch it on"),
        (
            "nan-limit",
            "the capability `max_force_n` is [NaN, NaN, NaN]: must be 0 to 100000 N on each axis; report this to the \
             author of the plugin",
        ),
    ];
    for (fault, cause) in wrong {
        let ran = run_scene_with(&faulty_scene(""), &[&format!("device.fault={fault}")]);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        let error = ran.error();
        assert!(error.starts_with(&format!("{}: `{DEVICE}` refused: ", file.display())), "{error}");
        assert!(error.ends_with(cause), "{error}");
    }
}

#[test]
fn a_device_that_fails_in_the_loop_ends_the_run_in_one_line() {
    let file = plugin_file(DEVICE);
    let wrong = [
        ("panics-in-read", ": read gave up", "report the fault to its author"),
        ("panics-in-write", ": write gave up", "report the fault to its author"),
        ("over-temperature", "a coil is too hot", "let the device cool"),
    ];
    for (fault, cause, remedy) in wrong {
        let ran = run_scene_with(&faulty_scene(""), &[&format!("device.fault={fault}"), "device.at_tick=7"]);
        assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
        let error = ran.error();
        assert!(error.starts_with(&format!("{}: device fault: ", file.display())), "{error}");
        assert!(error.contains(cause) && error.contains(remedy), "{error}");
        assert!(ran.stdout.contains("ticks      8 "), "the fault came at tick 7: {ran:#?}");
    }
}

#[test]
fn a_device_without_a_sample_gets_no_force_once_the_last_one_is_old() {
    let device = "[device.parameters]\nfault = \"nan-sample\"\nat_tick = 7\n[[model]]";
    let records = watch(&faulty_scene("").replacen("[[model]]", device, 1)).records;
    assert_eq!(records.len(), 50);
    for record in &records {
        // Ten ticks of the last pose, then nothing: what is older is not where the hand is.
        let force = if record.tick < 7 + 10 { honest() } else { Wrench::ZERO };
        assert_eq!(record.commanded, force, "tick {}", record.tick);
        assert_eq!(record.events.intersects(Events::NOT_FINITE), record.tick >= 7, "tick {}", record.tick);
    }
}

/// A run of the faulty device whose samples are odd from tick 50 on, and what the device itself says it was commanded: the
/// vertical force of each tick, N.
fn run_with_odd_samples(sample: &str) -> (Ran, Vec<(u64, f64)>) {
    let scratch = Scratch::default();
    let scene = faulty_scene("").replace("duration_s = 0.05", "duration_s = 1");
    let (scene, log) = (scratch.file("scene.toml", scene), scratch.path().join("commanded"));
    let sets = ["--set", &format!("device.sample={sample}"), "--set", "device.at_tick=50"]
        .map(std::ffi::OsString::from);
    let arguments = ["run".into(), scene.into_os_string(), "--clock".into(), "virtual".into()];
    let flotor = Flotor::with(arguments.into_iter().chain(sets));
    let ran = flotor.env(fixture_faulty_device::LOG_FILE_VARIABLE, &log.display().to_string()).run();
    let text = std::fs::read_to_string(&log).unwrap_or_else(|_| panic!("it was never commanded: {ran:#?}"));
    let command = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |place: usize| words[place].parse::<f64>().expect("a number");
        assert!([1, 2, 4, 5, 6].iter().all(|place| number(*place) == 0.0), "{line}");
        (words[0].parse().expect("a tick"), number(3))
    };
    (ran, text.lines().map(command).collect())
}

#[test]
fn a_device_without_a_usable_sample_gets_no_force_and_is_named_with_the_reason() {
    let good = run_with_odd_samples("nothing");
    assert_eq!(good.0.code, Some(exit_code::OK), "{:#?}", good.0);
    assert!(good.1.len() == 1000 && good.1.iter().all(|(_, force_n)| *force_n == 0.1), "the control run");

    // Why, and the last tick with a force: ten samples that cannot be are borne. That the same sample comes again, or a
    // noisy pose with the same bits, can be for a while.
    let odd = [
        ("far", "range", 59),
        ("below", "range", 59),
        ("long-quaternion", "quaternion", 59),
        ("zero-quaternion", "quaternion", 59),
        ("fast", "speed", 59),
        ("old", "time", 59),
        ("future", "time", 59),
        ("backwards", "time", 60),
        ("nan", "not finite", 59),
        ("same-time", "time", 70),
        ("stuck", "stuck", 109),
    ];
    for (sample, why, last) in odd {
        let (ran, commanded) = run_with_odd_samples(sample);
        assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{sample}: {ran:#?}");
        for (tick, force_n) in &commanded {
            assert_eq!(*force_n, if *tick <= last { 0.1 } else { 0.0 }, "{sample}: tick {tick}");
        }
        // 101 samples of this kind: a tenth of a second.
        let told = format!(
            "{}: device fault: 101 implausible samples ({why} 101), the first at tick {}; ",
            plugin_file(DEVICE).display(),
            last - 9
        );
        assert!(ran.error().starts_with(&told), "{sample}: {ran:#?}");
        assert!(ran.stdout.contains(&format!("({why} 101), the first at tick")), "the summary: {ran:#?}");
        let event = if sample == "nan" { "not_finite 101" } else { "implausible_sample 101" };
        assert!(ran.stdout.contains(event), "{sample}: {ran:#?}");
    }
}

#[test]
fn a_device_that_jumps_about_is_found_out_although_every_pose_could_be() {
    for (sample, why) in [("teleports", "speed"), ("shakes", "acceleration")] {
        let (ran, commanded) = run_with_odd_samples(sample);
        assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{sample}: {ran:#?}");
        assert!(ran.error().contains(&format!(" implausible samples ({why} ")), "{sample}: {ran:#?}");
        let with_force = commanded.iter().filter(|(tick, force_n)| *tick >= 50 && *force_n != 0.0).count();
        assert!(with_force < 50, "{sample}: {with_force} ticks with a force before it is withdrawn");
        assert!(ran.stdout.contains("holding "), "{sample}: {ran:#?}");
    }
}

#[test]
fn a_sample_in_ten_that_cannot_be_takes_the_force_away_and_a_single_one_is_borne_and_told() {
    let (ran, commanded) = run_with_odd_samples("far-once-in-ten");
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stdout.contains("95 implausible samples (range 95), the first at tick 50"), "{ran:#?}");
    assert!(commanded.iter().all(|(_, force_n)| [0.0, 0.1].contains(force_n)));
    assert!(commanded.iter().filter(|(tick, _)| *tick >= 300).all(|(_, force_n)| *force_n == 0.0));

    let (ran, commanded) = run_with_odd_samples("far-once");
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stdout.contains("1 implausible sample (range 1), the first at tick 50"), "{ran:#?}");
    assert!(ran.stdout.contains("implausible_sample 1"), "{ran:#?}");
    assert!(commanded.iter().all(|(_, force_n)| *force_n == 0.1), "nothing of it is felt");
}

#[test]
fn a_device_that_takes_no_command_is_stopped_and_named() {
    let (ran, commanded) = run_with_odd_samples("takes-nothing");
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
    assert_eq!(commanded.last(), Some(&(49, 0.1)), "the control: it took those before");
    let told = format!(
        "{}: device fault: the device has not read the last 101 commands; ",
        plugin_file(DEVICE).display()
    );
    assert!(ran.error().starts_with(&told), "{ran:#?}");
}

#[test]
fn validate_finds_what_a_model_does_wrong() {
    let wrong = [
        ("panics-in-create", "defaults", "create gave up"),
        ("panics-in-step", "finite-near-home", "step gave up at tick 0"),
        ("nan", "finite-near-home", "NaN"),
    ];
    for (fault, rule, cause) in wrong {
        assert_validate_finds(MODEL, fixture_faulty_model::FAULT_VARIABLE, fault, rule, cause);
    }
}

#[test]
fn validate_finds_what_a_device_does_wrong() {
    let wrong = [
        ("panics-in-open", "defaults", "open gave up"),
        ("nan-limit", "capabilities", "max_force_n"),
        ("refuses-to-activate", "lifecycle", "the power supply is off"),
        ("panics-in-read", "lifecycle", "read at tick 0"),
        ("panics-in-write", "lifecycle", "write at tick 0"),
        ("nan-sample", "lifecycle", "NaN"),
        ("over-temperature", "lifecycle", "a coil is too hot"),
    ];
    for (fault, rule, cause) in wrong {
        assert_validate_finds(DEVICE, fixture_faulty_device::FAULT_VARIABLE, fault, rule, cause);
    }
}

fn assert_validate_finds(package: &str, variable: &str, fault: &str, rule: &str, cause: &str) {
    let file = plugin_file(package);
    let ran = Flotor::with(["validate".as_ref(), file.as_os_str()]).env(variable, fault).run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{fault}: {ran:#?}");
    let error = ran.error();
    assert!(error.starts_with(&format!("{}: ", file.display())), "{error}");
    assert!(error.ends_with("rules violated"), "{error}");
    let failed = ran.stdout.split("  FAILED  ").find(|failed| failed.starts_with(rule));
    assert!(failed.is_some_and(|failed| failed.contains(cause)), "{fault}: {ran:#?}");
}

#[test]
fn validate_finds_nothing_wrong_with_honest_plugins() {
    for package in ["flotor-spring", "flotor-simulated", MODEL, DEVICE] {
        let ran = Flotor::with(["validate".as_ref(), plugin_file(package).as_os_str()]).run();
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
    }
}

#[test]
fn validate_survives_a_plugin_that_ends_the_process_and_checks_the_other_rules() {
    let scratch = Scratch::default();
    let library = scratch.path().join("libwall.so");
    compile_c_file(&workspace_root().join("tests/c/wall.c"), &["CRASHES"], &library); // from tick 50 on
    let ran = Flotor::with(["validate".as_ref(), library.as_os_str(), "--json".as_ref()]).run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    let findings: serde_json::Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let violated = |rule: &str| {
        let finding = findings.as_array().and_then(|all| all.iter().find(|finding| finding["rule"] == rule));
        finding.unwrap_or_else(|| panic!("{rule} was not checked: {findings}"))["violation"].clone()
    };
    assert_eq!(violated("finite-near-home"), serde_json::Value::Null);
    assert_eq!(violated("time-budget"), "the process died by signal 11");
    assert_eq!(violated("no-threads"), "the process died by signal 11");
    assert_eq!(violated("energy-gradient"), serde_json::Value::Null);
}

#[test]
fn validate_survives_a_plugin_that_hangs() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let arguments = ["validate".into(), plugin_file(MODEL).into_os_string(), "--timeout".into(), "3s".into()];
    let ran = Flotor::with(arguments).env(fixture_faulty_model::FAULT_VARIABLE, "hangs").run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    assert!(ran.stdout.contains("FAILED  finite-near-home"), "{ran:#?}");
    assert!(ran.stdout.contains("`step` did not return in tick 0 within 1 s"), "{ran:#?}");
}

/// One rule, asked in the process of its own that `flotor validate` starts for it.
fn verdict(rule: &str, fault: &str) -> String {
    let arguments = ["validate".into(), "--rule".into(), rule.into(), plugin_file(MODEL).into_os_string()];
    let ran = Flotor::with(arguments).env(fixture_faulty_model::FAULT_VARIABLE, fault).run();
    ran.stdout.lines().last().unwrap_or_default().to_owned()
}

#[test]
fn each_rule_of_a_loop_sees_the_model_that_breaks_it() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let good = r#"{"seen":null}"#;
    for rule in ["time-budget", "independent", "no-threads"] {
        assert_eq!(verdict(rule, "none"), good, "{rule}");
    }
    let judged = verdict("energy-gradient", "none");
    assert!(judged.contains("nothingtojudge"), "it gives no force and no energy: {judged}");
    let broken = [
        ("time-budget", "overruns", "above the limit of"),
        (
            "independent",
            "shares",
            "two instances stepped alternately return other results than one instance alone",
        ),
        ("no-threads", "starts-threads", "after 500 steps the process has more threads than before"),
        ("energy-gradient", "wrong-energy", "force and energy disagree in"),
    ];
    for (rule, fault, words) in broken {
        let told = verdict(rule, fault);
        assert!(told.contains(words), "{rule} with {fault}: {told}");
    }
}

// ---------------------------------------------------------------- what was meant

/// What the program says of a scene.
fn told_of(text: &str) -> String {
    let scratch = Scratch::default();
    let ran = Flotor::with(["run".as_ref(), scratch.file("scene.toml", text).as_os_str()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    ran.error().to_owned()
}

#[test]
fn a_table_of_a_wrong_name_and_a_key_below_the_wrong_table_are_reported() {
    let rest = "plugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
    let told = told_of(&format!("[devic]\n{rest}"));
    assert!(told.ends_with("unknown key `devic`; did you mean `device`?"), "{told}");
    let told = told_of(&format!("[device]\n{rest}rate_hz = 500\n"));
    assert!(
        told.ends_with("scene.toml:5: unknown key `model.rate_hz`; `rate_hz` belongs above all tables"),
        "{told}"
    );
}

#[test]
fn an_id_is_looked_for_among_plugins_of_both_kinds_and_nothing_unlike_it_is_suggested() {
    for (id, told) in [
        ("simulatd", "no plugin `simulatd`; did you mean `simulated`?"),
        ("sprang", "no plugin `sprang`; did you mean `spring`?"),
        ("jelly", "no plugin `jelly` (`flotor plugins` lists all; FLOTOR_PLUGIN_PATH adds folders)"),
    ] {
        let ran = Flotor::with(["plugins", id]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().starts_with(told), "{id}: {ran:#?}");
    }
}

#[test]
fn emulate_helps_with_itself_until_a_name_is_given() {
    for help in ["--help", "-h"] {
        let ran = Flotor::with(["emulate", help]).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
        assert!(ran.stdout.contains("flotor emulate <NAME>"), "{ran:#?}");
    }
    // There is no such emulator: who asks for its help is told so.
    let ran = Flotor::with(["emulate", "nothing", "--help"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().contains("no emulator `flotor-nothing-emulator`"), "{ran:#?}");
    let ran = Flotor::with(["emulate", "--port", "9999"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().starts_with("`--port` is not the name of an emulator"), "{ran:#?}");
    let ran = Flotor::with(["emulate", "maglev", "--set", "preset=xx"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().starts_with("--set preset=xx: `preset` = `xx`: must be "), "{ran:#?}");
}
