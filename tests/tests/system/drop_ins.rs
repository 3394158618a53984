//! Programs of other makers' interfaces: the libraries that stand in for theirs export what those do, drive any device inside its
//! limits, and whatever a program does, neither limits nor summary go with it.

use super::campaign::log::{Allowed, Seen, check, read};
use flotor_hal::DVec3;
use flotor_record::Recording;
use flotor_tests::library::{build_folder, compile_c_file};
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use flotor_tests::tools::{self, Tool};
use flotor_tests::{TestSize, workspace_root};
use object::read::elf::ElfFile64;
use object::{Object, ObjectSymbol};
use rustix::process::Signal;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// What a plugin looks for before it loads a maker's library.
const MARKER: &str = "flotor_dropin";

const HD: &str = "hdInitDevice hdDisableDevice hdMakeCurrentDevice hdGetCurrentDevice hdBeginFrame hdEndFrame \
    hdGetBooleanv hdGetIntegerv hdGetFloatv hdGetDoublev hdGetLongv hdGetString hdSetBooleanv hdSetIntegerv hdSetFloatv \
    hdSetDoublev hdSetLongv hdEnable hdDisable hdIsEnabled hdGetError hdGetErrorString hdCheckCalibration \
    hdCheckCalibrationStyle hdUpdateCalibration hdUpdateCalibrationMessage hdStartScheduler hdStopScheduler \
    hdSetSchedulerRate hdScheduleAsynchronous hdScheduleSynchronous hdUnschedule hdWaitForCompletion \
    hdGetSchedulerTimeStamp hdScaleGimbalAngles hdDeploymentLicense";

const PHANTOM: &str = "hdPhantomGetNumDevices hdPhantomOpen hdPhantomClose hdPhantomGetPosition \
    hdPhantomGetLinearVelocity hdPhantomGetRotation hdPhantomGetButtons hdPhantomSetForce hdPhantomSetTorque \
    hdPhantomSetForceAndTorque hdPhantomGetWorkspaceRadius hdPhantomGetType hdPhantomStartServo hdPhantomStopServo";

/// Largest force of the built-in scene, N.
pub(super) const MOST_N: f64 = 8.0;

/// What a library exports, sorted.
fn exported(library: &Path) -> Vec<String> {
    let bytes = std::fs::read(library).expect("it is built");
    let file: ElfFile64<'_> = ElfFile64::parse(&*bytes).expect("it is a library");
    let mut names: Vec<String> = file
        .dynamic_symbols()
        .filter(|symbol| symbol.is_definition() && symbol.is_global())
        .map(|symbol| symbol.name().expect("a name is text").to_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn each_library_exports_the_names_of_its_interface_and_a_mark() {
    let folder = build_folder().join("deps");
    let dhd = std::fs::read_to_string(workspace_root().join("tests/data/cases/dhd-names.txt"))
        .expect("the table is there");
    let cases = [
        ("libdrd.so", dhd.as_str(), 233, "libdrd.so.3"),
        ("libHD.so", HD, 36, "libHD.so.3.4"),
        ("libhdPhantom.so", PHANTOM, 14, "libhdPhantom.so"),
    ];
    for (library, names, count, own_name) in cases {
        let mut expected: Vec<&str> = names.split_whitespace().collect();
        assert_eq!(expected.len(), count, "{library}");
        expected.push(MARKER);
        expected.sort_unstable();
        assert_eq!(exported(&folder.join(library)), expected, "{library}");
        let bytes = std::fs::read(folder.join(library)).expect("it is built");
        let text = format!("\0{own_name}\0");
        assert!(
            bytes.windows(text.len()).any(|window| window == text.as_bytes()),
            "{library} calls itself otherwise"
        );
    }
}

/// The program in C that looks for a Phantom, compiled.
fn phantom(scratch: &Scratch) -> PathBuf {
    compiled(scratch, "phantom")
}

/// A program in C, compiled.
fn compiled(scratch: &Scratch, name: &str) -> PathBuf {
    let program = scratch.path().join(name);
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", "-o"]).arg(&program);
    let source = workspace_root().join(format!("tests/c/programs/{name}.c"));
    compiler.arg(source).args(["-ldl", "-lm", "-lpthread"]);
    let output = compiler.output().expect("a C compiler is installed; the README asks for one");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program
}

#[test]
fn numbers_and_errors_are_those_of_each_interface() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = compiled(&scratch, "numbers");
    for (api, library) in [("openhaptics", "hd"), ("dhd", "dhd")] {
        let ran = lent(&program, &["--api", api, "--pace", "lockstep"], library, 1);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        assert!(ran.stdout.starts_with("0 wrong\n"), "{api}: {}", ran.stdout);
    }
}

#[test]
fn the_built_in_scene_limits_the_slew_of_a_program_that_reverses_its_force() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let (program, recording) = (phantom(&scratch), scratch.path().join("steps.mcap"));
    let ran =
        lent(&program, &["--pace", "lockstep", "--record", &recording.display().to_string()], "steps", 400);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let forces_n: Vec<_> = Recording::open(&recording)
        .expect("it can be read")
        .map(|record| record.expect("it is whole").commanded.force())
        .collect();
    // The part of a force that accelerates the handle may fall at once: all of these forces are in the ball between the last force
    // and zero. What is outside has risen.
    let rise_n = |pair: &[DVec3]| (pair[1] - 0.5 * pair[0]).length() - 0.5 * pair[0].length();
    let largest_n = forces_n.windows(2).map(rise_n).fold(0.0, f64::max);
    // 2000 N/s at 1 kHz.
    assert!(largest_n > 1.9 && largest_n <= 2.0 + 1.0e-9, "{largest_n} N in a tick");
}

/// Asks for the type of the device and for its encoders as the bindings of the package index do.
const BINDINGS: &str = "\
import ctypes\n\
drd = ctypes.CDLL('libdrd.so.3')\n\
assert drd.drdOpen() == 0\n\
drd.dhdEnableExpertMode()\n\
counts = [ctypes.c_int() for _ in range(3)]\n\
print('type', drd.dhdGetSystemType(-1))\n\
print('encoders', drd.dhdGetDeltaEncoders(*map(ctypes.byref, counts), -1))\n\
drd.drdClose(-1)\n";

#[test]
fn a_program_in_python_sees_a_type_that_its_bindings_know_and_one_in_c_what_chai3d_does_not_shift() {
    if !tools::required(Tool::Python) || !tools::required(Tool::Cc) {
        return;
    }
    let lend = ["lend", "--api", "dhd", "--pace", "lockstep", "--", "python3", "-c", BINDINGS];
    let ran = Flotor::with(lend).run();
    assert_eq!((fact(&ran, "type"), fact(&ran, "encoders")), (104.0, 0.0), "{ran:?}");
    let scratch = Scratch::default();
    let source = scratch.file(
        "type.c",
        "#include <dlfcn.h>\n#include <stdio.h>\nint main(void) { void *drd = dlopen(\"libdrd.so.3\", RTLD_NOW);\n\
         int (*open)(void) = (int (*)(void))dlsym(drd, \"drdOpen\"), (*type)(int) = (int (*)(int))dlsym(drd, \"dhdGetSystemType\");\n\
         return open() < 0 || printf(\"type %d\\n\", type(-1)) < 0; }\n",
    );
    let program = scratch.path().join("type");
    let compiled = Command::new("cc").arg("-o").arg(&program).arg(&source).arg("-ldl").status();
    assert!(compiled.is_ok_and(|compiled| compiled.success()), "it compiles");
    let ran = lent(&program, &["--api", "dhd", "--pace", "lockstep"], "", 0);
    assert_eq!(fact(&ran, "type"), 108.0, "{ran:?}");
}

#[test]
fn a_program_that_lost_the_library_path_and_a_duration_that_does_not_apply_are_told() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", "duration_s = 3\n[device]\nplugin = \"simulated\"\n");
    let ran =
        Flotor::with(["lend", &scene.display().to_string(), "--", "env", "-i", "/bin/sh", "-c", "exit 7"])
            .run();
    assert_eq!(ran.code, Some(7), "{ran:?}");
    assert!(
        ran.stderr.contains("opened no device") && ran.stderr.contains("`env -i` removes the variable"),
        "{ran:?}"
    );
    assert!(ran.stderr.contains("`duration_s` does not apply"), "{ran:?}");
}

#[test]
fn the_summary_of_a_program_has_numbers_and_causes_that_a_person_reads() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = compiled(&scratch, "deeds");
    let deed = |way| lent(&program, &["--api", "dhd", "--pace", "lockstep"], way, 0);
    let huge = deed("huge");
    assert!(huge.stdout.contains("asked for 1.7e308 N and 1.7e308 N·m at most"), "{huge:?}");
    let nan = deed("nan");
    assert!(nan.stdout.contains("600 wrenches") && nan.stdout.contains("500 refused, not finite"), "{nan:?}");
    // Without a slew limit, under which a square wave is damped and does not end the run.
    let fast = "[device]\nplugin = \"simulated\"\n[limits]\nforce_n = 8\ntorque_nm = 0.15\n";
    let fast = scratch.file("fast.toml", fast).display().to_string();
    let square = lent(&program, &["--api", "dhd", "--pace", "lockstep", &fast], "square", 0);
    let cause = "the run ended before the program: the force oscillated between its limits";
    assert!(square.stdout.contains(cause), "{square:?}");
}

/// In real time: lockstep has no thread that a deed of the program could harm.
#[test]
fn what_a_program_does_to_its_process_leaves_limits_exit_code_and_recording() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = compiled(&scratch, "deeds");
    // In a debug build the standard library aborts the process when a descriptor of its own is closed.
    let descriptors = if cfg!(debug_assertions) { 128 + 6 } else { 0 };
    let deeds = [
        ("descriptors", descriptors),
        ("pipes", 0),
        ("room", 0),
        ("files", 0),
        ("folder", 0),
        ("unload", 0),
        ("reopen", 0),
        ("exec", 0),
        ("leave", 7),
        ("quick", 7),
        ("signal", 42),
        ("return", 5),
    ];
    show_each(&deeds, |(way, code)| {
        let recording = scratch.path().join(format!("{way}.mcap"));
        let ran = lent(&program, &["--api", "dhd", "--record", &recording.display().to_string()], way, 0);
        let code = if *code == 0 && has_failed(&ran) { exit_code::DEVICE_FAULT } else { *code };
        assert_eq!(ran.code, Some(code), "{way}: {ran:?}");
        let (largest_n, ticks) = largest_n(&recording);
        // A file that the program closed or replaced ends up to a quarter of a second earlier.
        let is_cut = ["descriptors", "pipes"].contains(way);
        let least_n = if is_cut { 0.0 } else { 1.9 };
        assert!(largest_n >= least_n && largest_n <= MOST_N * (1.0 + 1.0e-12), "{way}: {largest_n} N");
        assert!(ticks > 10, "{way}: {ticks} ticks");
        assert!(ran.stdout.contains("  program    `device` opened "), "{way}: {ran:?}");
    });
}

/// A motion that a program has printed: result, number of the error, distance from the place in m, whether it goes on.
fn motion(ran: &Ran, name: &str) -> (i32, i32, f64, bool) {
    let line = ran.stdout.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    let words: Vec<&str> = line.unwrap_or_else(|| panic!("no {name}: {ran:?}")).split(' ').collect();
    let number = |index: usize| words[index].parse().expect("a number");
    (number(0), number(1), words[2].parse().expect("a distance"), words[3] == "1")
}

#[test]
fn a_motion_ends_where_the_handle_has_arrived_and_one_that_a_hand_prevents_is_an_error() {
    if !tools::required(Tool::Cc) {
        return;
    }
    /// Largest distance of a handle that has arrived, m: 1 mm, and what it moves in a tick at 25 mm/s.
    const ARRIVED_M: f64 = 1.025e-3;
    /// Number of the interface's timeout.
    const TIMEOUT: i32 = 7;
    let scratch = Scratch::default();
    let program = compiled(&scratch, "move");
    let free =
        scratch.file("free.toml", "[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"open\"\n");
    let free = free.display().to_string();
    for pace in ["lockstep", "real"] {
        let ran = lent(&program, &["--api", "dhd", "--pace", pace, &free], "", 0);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        for name in ["right", "left", "turned", "home"] {
            let (result, _, away_m, is_moving) = motion(&ran, name);
            assert!(result == 0 && away_m < ARRIVED_M && !is_moving, "{pace}, {name}: {ran:?}");
        }
        assert_eq!(fact(&ran, "moving"), 1.0, "{ran:?}");
    }
    // A hand of 2000 N/m against the spring of 400 N/m: the handle goes a sixth of the way, and home is where the hand is.
    let ran = lent(&program, &["--api", "dhd", "--pace", "lockstep"], "", 0);
    for name in ["right", "left", "turned"] {
        let (result, error, away_m, is_moving) = motion(&ran, name);
        assert!(result == -1 && error == TIMEOUT && away_m > ARRIVED_M && !is_moving, "{name}: {ran:?}");
    }
    assert!(motion(&ran, "home").2 < ARRIVED_M, "{ran:?}");
}

#[test]
fn a_program_that_only_reads_goes_on_in_lockstep_and_is_told_why() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = compiled(&scratch, "wait");
    for (api, way) in [("dhd", "dhd"), ("chai3d", "phantom")] {
        // The hand needs a few hundred ticks for 2 mm, at 0.7 Hz and 5 mm; a tick takes a hundred reads.
        let runs = [(); 2].map(|()| lent(&program, &["--api", api, "--pace", "lockstep"], way, 1_000_000));
        for ran in &runs {
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
            assert_eq!(ran.stderr.matches("this program only reads").count(), 1, "{ran:?}");
        }
        let [first, second] = runs.each_ref().map(|ran| fact(ran, "reads"));
        assert!(first > 1_000.0 && first == second, "{first} and {second} reads");
    }
}

/// Lends it the built-in device.
fn lent(program: &Path, options: &[&str], way: &str, calls: usize) -> Ran {
    let (program, calls) = (program.display().to_string(), calls.to_string());
    let arguments = [&["lend"], options, &["--", &program, way, &calls]].concat();
    Flotor::with(arguments).run()
}

/// A fact the program has printed.
fn fact(ran: &Ran, name: &str) -> f64 {
    let line = ran.stdout.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("no {name}: {ran:?}"))
}

/// Whether the run ended before the program did.
fn has_failed(ran: &Ran) -> bool {
    ran.stdout.contains("the run ended before the program: ")
}

/// Largest force that was sent, N, and ticks of a recording; all of it is finite.
pub(super) fn largest_n(recording: &Path) -> (f64, usize) {
    let mut largest = (0.0_f64, 0);
    for record in Recording::open(recording).expect("it can be read") {
        let Ok(record) = record else { break }; // cut off where the program was killed
        assert!(record.commanded.is_finite() && record.pose.is_finite(), "{record:?}");
        largest = (largest.0.max(record.commanded.force().length()), largest.1 + 1);
    }
    largest
}

#[test]
fn the_motion_of_a_lent_run_is_replayed_with_a_model_in_the_place_of_the_program() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let recording = scratch.path().join("lent.mcap").display().to_string();
    let ran = lent(&phantom(&scratch), &["--pace", "lockstep", "--record", &recording], "plain", 300);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran = Flotor::with(["replay", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(
        ran.error().contains("the forces of `program` came from an external program")
            && ran.error().contains("--model program=spring")
    );
    let ran = Flotor::with(["replay", &recording, "--model", "program=spring"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
}

#[test]
fn a_program_drives_a_device_without_a_changed_line_and_in_lockstep_bit_for_bit() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = phantom(&scratch);
    let summary = scratch.path().join("summary.json");
    let options = ["--pace", "lockstep", "--json", &summary.display().to_string()];
    let run = || {
        let ran = lent(&program, &options, "plain", 3000);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let text = std::fs::read_to_string(&summary).expect("a summary was requested");
        (ran, serde_json::from_str::<Value>(&text).expect("it is JSON"))
    };
    let (ran, first) = run();
    assert!(ran.stdout.contains("type Flotor simulated\nradius 0.012\n"), "{ran:?}");
    // The hand moves the handle by some millimetres; rotations are orthonormal to rounding.
    assert!(fact(&ran, "highest") - fact(&ran, "lowest") > 1.0e-3, "{ran:?}");
    assert!(fact(&ran, "slant") < 1.0e-12, "{ran:?}");
    // Velocity against differences of positions: at most what a tick of acceleration makes, 8 N on a kilogram.
    assert!(fact(&ran, "lag") < 0.03, "{ran:?}");
    assert_eq!(fact(&ran, "failed"), 0.0);
    assert!(ran.stdout.contains("close 0\nclose -1\nafter -1\n"), "{ran:?}");
    // One tick at the start, one for each command; the last, which was refused, made none.
    assert_eq!(first["ticks"], 3001);
    assert_eq!(run().1["trace_digest"], first["trace_digest"]);
}

/// What the device of the scene below may be told: its own share of each axis, under one norm for all.
const ALLOWED: Allowed = Allowed {
    norm: [MOST_N, 0.5],
    axes: [[MOST_N; 3], [0.5; 3]],
    slew_per_s: [5_000.0, 500.0],
    rise_per_s: [5_000.0, 500.0],
};

/// A scene of a device that writes down what it is told (`tests/c/campaign/device.c`).
fn with_a_log(scratch: &Scratch, device: &Path, log: &Path, name: &str) -> PathBuf {
    let text = format!(
        "duration_s = 1.0e6\n[device]\nplugin = {device:?}\n[device.parameters]\nlog = {log:?}\nforce = 50.0\ntorque = 5.0\n\
         slew = 5000.0\nrange_mm = 12.0\n[limits]\nforce_n = {MOST_N:?}\ntorque_nm = 0.5\n"
    );
    scratch.file(&format!("{name}.toml"), &text)
}

#[test]
fn nothing_a_program_does_gets_past_the_limits_or_takes_report_and_recording_with_it() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = phantom(&scratch);
    let device = scratch.path().join("libdevice.so");
    compile_c_file(&workspace_root().join("tests/c/campaign/device.c"), &["SIMULATED"], &device);
    // In lockstep a tick a call: as many as are wanted, and as a log has room for. What depends on time or dies runs in real time.
    let (calls, rounds) = (TestSize::of_this_run().pick(2_000, 120_000), TestSize::of_this_run().pick(1, 5));
    let in_lockstep = ["steps", "huge", "nan"].map(|way| (way, "lockstep", calls));
    let in_real_time = [
        ("plain", "real", 600),
        ("steps", "real", 600),
        ("stall", "real", 250),
        ("fork", "real", 600),
        ("threads", "real", 50),
        ("forget", "real", 600),
        ("kill", "real", 1600),
        ("crash", "real", 1600),
    ];
    let cases: Vec<_> =
        std::iter::repeat_n(in_lockstep, rounds).flatten().chain(in_real_time).enumerate().collect();
    let told = AtomicUsize::new(0);
    show_each(&cases, |(number, (way, pace, calls))| {
        let name = format!("{number}-{way}");
        let [recording, log] = ["mcap", "log"].map(|kind| scratch.path().join(format!("{name}.{kind}")));
        let scene = with_a_log(&scratch, &device, &log, &name).display().to_string();
        let ran = lent(
            &program,
            &["--pace", pace, "--record", &recording.display().to_string(), &scene],
            way,
            *calls,
        );
        let (largest_n, ticks) = largest_n(&recording);
        assert!(largest_n <= MOST_N * (1.0 + 1.0e-12), "{way}: {largest_n} N");
        assert!(
            ticks > 100 && ran.stdout.contains("  program    `device` opened "),
            "{way}: {ticks} ticks, {ran:?}"
        );
        let Seen { commands, felt, violations } = check(&read(&log), &ALLOWED);
        told.fetch_add(commands, Ordering::Relaxed);
        // Nothing stops this device once its process is gone at a blow, and the host says so when it pairs a real one.
        let dies = ["kill", "crash"].contains(way);
        let left: Vec<_> = violations.iter().filter(|(_, what)| !(dies && *what == "force stays")).collect();
        assert!(left.is_empty(), "{way}: {left:?}");
        assert!(felt > 50 || *way == "nan", "{way}: force in {felt} of {commands} commands");
        let expected = match *way {
            "kill" => 128 + 9,
            "crash" => 128 + 6,
            _ if has_failed(&ran) => exit_code::DEVICE_FAULT,
            _ => exit_code::OK,
        };
        assert_eq!(ran.code, Some(expected), "{way}: {ran:?}");
        if (*way, *pace) == ("steps", "lockstep") {
            assert!(ran.stdout.contains("the force oscillated between its limits"), "{ran:?}");
        }
        match *way {
            "steps" | "huge" => assert!(largest_n > 0.9 * MOST_N, "{way}: only {largest_n} N"),
            "nan" => assert!(ran.stdout.contains("refused, not finite"), "{ran:?}"),
            "stall" => assert!(ran.stdout.contains("expired without a newer wrench"), "{ran:?}"),
            "fork" => assert!(ran.stdout.contains("child 0\n"), "{ran:?}"),
            "kill" | "crash" => assert!(ran.stdout.contains("s so far"), "{ran:?}"),
            _ => {}
        }
    });
    let told = told.into_inner();
    println!("{told} commands in the device's own log");
    assert!(told >= TestSize::of_this_run().pick(0, 1_000_000), "{told} commands");
}

#[test]
fn what_cannot_be_lent_is_said_in_one_line_with_what_helps() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = phantom(&scratch).display().to_string();
    let source =
        scratch.file("linked.c", "const char *name = \"libHD.so\"; int main(void) { return name == 0; }\n");
    let compile = |output: &str, options: &[&str]| {
        let output = scratch.path().join(output);
        let compiled = Command::new("cc").args(options).arg("-o").arg(&output).arg(&source).output();
        compiled.is_ok_and(|compiled| compiled.status.success()).then(|| output.display().to_string())
    };
    let linked = compile("linked", &[]).expect("it compiles");
    let mut cases = vec![
        (vec!["--api", "falcon", "--", &program], "dhd, openhaptics, chai3d"),
        (vec!["--", "no-such-program"], "there is no program `no-such-program`"),
        (vec!["--api", "dhd", "--", &linked], "--api openhaptics"),
        (vec!["no-such-scene.toml", "--", &program], "`no-such-scene.toml` is not a scene file"),
    ];
    let broken =
        scratch.file("broken.toml", "[device]\nplugin = \"simulated\"\nspeed = 3\n").display().to_string();
    cases.push((vec![&broken, "--", &program], "broken.toml:3"));
    let unknown = scratch.file("unknown.toml", "[device]\nplugin = \"simulatd\"\n").display().to_string();
    cases.push((
        vec![&unknown, "--", &program],
        "unknown.toml:2: no device plugin `simulatd`; did you mean `simulated`?",
    ));
    let setting = "[device]\nplugin = \"simulated\"\n[device.parameters]\nhnad = \"press\"\n";
    let setting = scratch.file("setting.toml", setting).display().to_string();
    cases.push((vec![&setting, "--", &program], "setting.toml:4: [device] no parameter `hnad`"));
    let small = scratch.path().join("small");
    std::fs::write(&small, b"\x7fELF\x01\x01\x01").expect("there is room");
    std::fs::set_permissions(&small, std::fs::Permissions::from_mode(0o755)).expect("it is ours");
    let small = small.display().to_string();
    cases.push((vec!["--", &small], "32-bit program"));
    let fixed = compile("static", &["-static"]);
    if let Some(fixed) = &fixed {
        cases.push((vec!["--", fixed], "statically linked"));
    }
    for (arguments, said) in cases {
        let ran = Flotor::with([vec!["lend"], arguments.clone()].concat()).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{arguments:?}: {ran:?}");
        assert!(ran.error().contains(said), "{arguments:?}: {ran:?}");
        assert_eq!(ran.stderr.trim_end().lines().count(), 1, "{arguments:?}: {ran:?}");
    }
    // Without a library: the programs in a folder of their own.
    let alone = scratch.folder("alone");
    let programs = ["flotor", "flotor-lend"].map(|name| build_folder().join(name));
    // By a process of its own: a file that this one has open for writing cannot be started while another test forks.
    let copied = Command::new("cp").args(programs).arg(&alone).status();
    assert!(copied.is_ok_and(|copied| copied.success()), "they can be copied");
    let lend = ["lend", "--api", "chai3d", "--", &program];
    let output = Command::new(alone.join("flotor")).args(lend).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("build it with `cargo build --release -p flotor-chai3d`")
            && said.trim_end().lines().count() == 1,
        "{said}"
    );
}

/// What a run has told, as JSON.
fn json_of(file: &Path) -> Value {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    serde_json::from_str(&text).expect("it is JSON")
}

#[test]
fn the_summary_as_json_is_there_however_the_program_ends() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = phantom(&scratch);
    for (way, end) in [("kill", "killed by signal 9"), ("crash", "killed by signal "), ("plain", "stopped")] {
        let json = scratch.path().join(format!("{way}.json"));
        let _ = lent(&program, &["--json", &json.display().to_string()], way, 1600);
        let summary = json_of(&json);
        assert!(
            summary["end"].as_str().is_some_and(|told| told.starts_with(end)),
            "{way}: {}",
            summary["end"]
        );
        assert!(summary["ticks"].as_u64().is_some_and(|ticks| ticks > 100), "{way}: {summary:#}");
    }
    let json = scratch.path().join("none.json");
    let ran = Flotor::with(["lend", "--json", &json.display().to_string(), "--", "sh", "-c", "exit 7"]).run();
    assert_eq!(ran.code, Some(7), "{ran:?}");
    let end = json_of(&json)["end"].to_string();
    assert!(end.contains("opened no device: ended with exit code 7"), "{end}");
}

#[test]
fn processes_of_one_program_have_files_of_their_own_which_a_note_names() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let program = phantom(&scratch).display().to_string();
    let [record, json] = ["r.mcap", "r.json"].map(|name| scratch.path().join(name).display().to_string());
    for both in ["\"$0\" plain 600 & \"$0\" plain 600 & wait", "\"$0\" plain 600; \"$0\" plain 600"] {
        let options = ["lend", "--api", "chai3d", "--record", &record, "--json", &json];
        let ran = Flotor::with(options.iter().chain(&["--", "sh", "-c", both, &program])).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let second = scratch.path().join("r-2.mcap");
        assert!(
            ran.stderr.contains(&format!("the recording of this run is `{}`", second.display())),
            "{ran:?}"
        );
        for recording in [Path::new(&record), &second] {
            let records = Recording::open(recording).expect("it can be read");
            let whole: Result<Vec<_>, _> = records.collect();
            assert!(whole.expect("it is whole").len() > 100);
            std::fs::remove_file(recording).expect("it is there");
        }
        for file in ["r.json", "r-2.json"] {
            assert_eq!(json_of(&scratch.path().join(file))["end"], "stopped", "{file}");
        }
    }
}

#[test]
fn a_program_ends_with_the_command_that_lends_it_a_device() {
    let program =
        ["lend", "--", "sh", "-c", "trap '' TERM INT HUP; echo $$ >&2; while :; do sleep 0.1; done"];
    let mut lend = Flotor::with(program).start();
    let mut errors = lend.stderr.take().map(BufReader::new).expect("it is a pipe");
    let mut line = String::new();
    let shell = loop {
        line.clear();
        assert!(errors.read_line(&mut line).expect("text") > 0, "the program did not start");
        if let Ok(number) = line.trim().parse::<u32>() {
            break number;
        }
    };
    lend.signal(Signal::KILL);
    let state = || std::fs::read_to_string(format!("/proc/{shell}/stat")).unwrap_or_default();
    let since = Instant::now();
    while !state().is_empty() && !state().contains(") Z ") {
        assert!(since.elapsed() < Duration::from_secs(30), "the program goes on: {}", state());
        std::thread::sleep(Duration::from_millis(5));
    }
}
