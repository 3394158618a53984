//! Plugins that do not come back, or leave the machine's state changed: before a run, in it, and when it is over.

use flotor_record::{Ending, Recording};
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use flotor_tests::watched::watch;
use flotor_tests::workspace_root;
use flotor_tests::{TestSize, holds_ticks};
use rustix::process::Signal;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The model of `tests/c/model_that.c` or the device of `tests/c/device_that.c`, with a habit: `IN_STEP=hang();`.
fn plugin_that(scratch: &Scratch, kind: &str, habit: &str) -> PathBuf {
    let name: String = habit.chars().filter(char::is_ascii_alphanumeric).collect();
    let library = scratch.path().join(format!("lib{kind}_{name}.so"));
    if !library.exists() {
        let source = workspace_root().join(format!("tests/c/{kind}_that.c"));
        compile_c_file(&source, &[habit], &library);
    }
    library
}

/// A scene of such a device and such a model, called `jelly`; `more` are further lines of the model and tables.
fn scene_of(scratch: &Scratch, device: &str, model: &str, more: &str) -> String {
    let [device, model] = [plugin_that(scratch, "device", device), plugin_that(scratch, "model", model)];
    let isolation = if more.contains("isolation") { "" } else { "isolation = \"none\"\n" };
    format!(
        "duration_s = 0.2\n[device]\nname = \"handle\"\nplugin = \"{}\"\n[[model]]\nname = \"jelly\"\nplugin = \"{}\"\n{isolation}{more}",
        device.display(),
        model.display()
    )
}

const HONEST: &str = "HONEST";

/// Runs a scene on a clock, recorded to `run.mcap`, with its summary in `run.json`; a call may take a second.
fn run(scratch: &Scratch, scene: &str, clock: &str) -> Ran {
    let path = |name: &str| scratch.path().join(name).display().to_string();
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let (recording, json) = (path("run.mcap"), path("run.json"));
    let _ = std::fs::remove_file(&recording); // of the run before
    let arguments = ["run", &scene, "--clock", clock, "--record", &recording, "--json", &json];
    Flotor::with(arguments).env("FLOTOR_CALL_LIMIT_S", "1").run()
}

/// The summary of that run.
fn summary(scratch: &Scratch) -> serde_json::Value {
    let text = std::fs::read_to_string(scratch.path().join("run.json")).expect("there is a summary");
    serde_json::from_str(&text).expect("a summary is JSON")
}

fn ending(scratch: &Scratch) -> Ending {
    let mut recording = Recording::open(&scratch.path().join("run.mcap")).expect("a recording");
    assert!(recording.by_ref().all(|record| record.is_ok()));
    recording.ending()
}

/// The line on standard error that names a plugin and its call.
fn named(ran: &Ran, who: &str, call: &str) -> bool {
    let told = format!("`{who}` did not return from {call} within ");
    ran.stderr.lines().any(|line| line.starts_with("error: ") && line.contains(&told))
}

/// Each case on both clocks; at quick size each on one, in turns.
fn on_both_clocks<T: Copy>(cases: &[T]) -> Vec<(T, &'static str)> {
    let both = cases.iter().enumerate().flat_map(|(number, case)| {
        let clocks = if number % 2 == 0 { ["real", "virtual"] } else { ["virtual", "real"] };
        clocks.into_iter().take(TestSize::of_this_run().pick(1, 2)).map(|clock| (*case, clock))
    });
    both.collect()
}

// ---------------------------------------------------------------- the end of a run

#[test]
fn a_plugin_that_hangs_at_the_end_costs_neither_the_recording_nor_the_summary_and_is_named() {
    let cases = [
        (HONEST, "IN_DESTROY=hang();", "jelly", "`destroy`"),
        ("IN_DEACTIVATE=hang();", HONEST, "handle", "`deactivate`"),
        ("IN_CLOSE=hang();", HONEST, "handle", "`close`"),
    ];
    show_each(&on_both_clocks(&cases), |((device, model, who, call), clock)| {
        let scratch = Scratch::default();
        let ran = run(&scratch, &scene_of(&scratch, device, model, ""), clock);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{who} {clock}: {ran:?}");
        assert!(named(&ran, who, call), "{clock}: {ran:?}");
        assert_eq!(summary(&scratch)["end"], "finished");
        assert_eq!(ending(&scratch), Ending::Finished);
    });
}

#[test]
fn a_model_that_ends_the_process_when_it_is_freed_costs_neither_the_recording_nor_the_summary() {
    let scratch = Scratch::default();
    let ran = run(&scratch, &scene_of(&scratch, HONEST, "IN_DESTROY=leave();", ""), "virtual");
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    assert!(
        ran.stderr.contains("error: `jelly` ended the process in `destroy`: it called `exit`\n"),
        "{ran:?}"
    );
    assert!(ran.stdout.contains("digest"), "{ran:?}");
    assert_eq!(summary(&scratch)["end"], "finished");
    assert_eq!(ending(&scratch), Ending::Finished);
}

/// `exit(0)` would else be a run that went well, and a crash one of which nobody says whose it was.
#[test]
fn a_plugin_that_ends_the_process_outside_the_loop_is_named_and_is_a_plugin_that_failed() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let (exit, abort, trap) = ("it called `exit`", "signal 6 (SIGABRT", "signal 4 (SIGILL");
    let cases = [
        (HONEST, "IN_CREATE=leave();", "`jelly`", "`create`", exit),
        (HONEST, "IN_CREATE=__builtin_trap();", "`jelly`", "`create`", trap),
        (HONEST, "IN_PREPARE=abort();", "`jelly`", "`prepare`", abort),
        (HONEST, "IN_INITIALISER=leave();", ".so`", "its initialisers", exit),
        (HONEST, "IN_DESTROY=abort();", "`jelly`", "`destroy`", abort),
        ("IN_OPEN=exit(0);", HONEST, "`handle`", "`open`", exit),
        ("IN_ACTIVATE=abort();", HONEST, "`handle`", "`activate`", abort),
        ("IN_DEACTIVATE=exit(0);", HONEST, "`handle`", "`deactivate`", exit),
        ("IN_CLOSE=abort();", HONEST, "`handle`", "`close`", abort),
    ];
    show_each(&on_both_clocks(&cases), |((device, model, who, call, words), clock)| {
        let scratch = Scratch::default();
        let ran = run(&scratch, &scene_of(&scratch, device, model, ""), clock);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{who} {call} {clock}: {ran:?}");
        let told = format!("{who} ended the process in {call}: {words}");
        let is_told = |line: &str| line.starts_with("error: ") && line.contains(&told);
        assert!(ran.stderr.lines().any(is_told), "{told} {clock}: {ran:?}");
    });
}

#[test]
fn a_loop_that_hangs_leaves_a_summary_for_machines() {
    let scratch = Scratch::default();
    let hangs = "IN_STEP=if (input->tick >= 100) { hang(); }";
    let ran = run(&scratch, &scene_of(&scratch, HONEST, hangs, ""), "real");
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    let summary = summary(&scratch);
    assert_eq!(summary["end"], "watchdog");
    let tick = summary["ticks"].as_u64().expect("a number");
    let health = summary["plugins"][1]["health"].as_str().unwrap_or_default();
    assert!(health.starts_with(&format!("`jelly` did not return from `step` in tick {tick};")), "{health}");
}

#[test]
fn a_device_that_hangs_when_it_is_told_to_stop_is_named() {
    let scratch = Scratch::default();
    let ran = run(&scratch, &scene_of(&scratch, "IN_STOP=hang();", HONEST, ""), "real");
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(named(&ran, "handle", "`safe_stop`"), "{ran:?}");
    assert_eq!(ending(&scratch), Ending::Finished);
}

#[test]
fn three_signals_end_a_run_whose_device_hangs_when_it_is_told_to_stop() {
    let scratch = Scratch::default();
    let scene = scene_of(&scratch, "IN_STOP=hang();", HONEST, "[limits]\nwatchdog_ms = 60000\n");
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join("run.mcap");
    let record = recording.display().to_string();
    let running = Flotor::with(["run", &scene, "--duration", "60s", "--record", &record]).start();
    let started = Instant::now();
    while !holds_ticks(&recording) && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    for _ in 0..3 {
        running.signal(Signal::INT);
        std::thread::sleep(Duration::from_millis(500));
    }
    assert_eq!(running.wait().code, Some(130));
}

#[test]
fn what_a_model_prints_does_not_mix_with_a_summary_for_machines() {
    let scratch = Scratch::default();
    let talks = "IN_CREATE=puts(\"good morning\");";
    let scene = scratch.file("scene.toml", scene_of(&scratch, HONEST, talks, "")).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let summary: serde_json::Value = serde_json::from_str(&ran.stdout).expect("nothing but JSON");
    assert_eq!(summary["end"], "finished");
    assert!(ran.stderr.contains("good morning"), "{ran:?}");
}

#[test]
fn a_run_in_real_time_without_room_for_files_is_refused() {
    let ran = Flotor::with(["run", "--duration", "1s"]).through_shell("ulimit -n 20; exec \"$@\"").run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().starts_with("the process may open only 20 files"), "{ran:?}");
}

// ---------------------------------------------------------------- before a run

#[test]
fn a_plugin_that_hangs_before_a_run_is_named_and_ends_it() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let cases = [
        (HONEST, "IN_INITIALISER=hang();", ".so", "its initialisers"),
        (HONEST, "IN_CREATE=hang();", "jelly", "`create`"),
        (HONEST, "IN_PREPARE=hang();", "jelly", "`prepare`"),
        ("IN_OPEN=hang();", HONEST, "handle", "`open`"),
        ("IN_ACTIVATE=hang();", HONEST, "handle", "`activate`"),
    ];
    show_each(&on_both_clocks(&cases), |((device, model, who, call), clock)| {
        let scratch = Scratch::default();
        let ran = run(&scratch, &scene_of(&scratch, device, model, ""), clock);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{call}: {ran:?}");
        let told = format!("{who}` did not return from {call} within 1 s");
        assert!(ran.stderr.contains(&told), "{call}: {ran:?}");
    });
    let scratch = Scratch::default();
    let isolated = scene_of(&scratch, HONEST, "IN_CREATE=hang();", "isolation = \"process\"\n");
    let ran = run(&scratch, &isolated, "virtual");
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    assert!(ran.error().contains("loading, `create` or `prepare` did not return within 1 s"), "{ran:?}");
}

#[test]
fn a_user_who_waits_is_told_for_whom() {
    let scratch = Scratch::default();
    let scene = scene_of(&scratch, HONEST, "IN_CREATE=hang();", "");
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let ran = Flotor::with(["run", &scene]).env("FLOTOR_CALL_LIMIT_S", "1").run();
    let told = "note: waiting for `jelly` to return from `create`, for up to 1 s\n";
    assert!(ran.stderr.starts_with(told), "{ran:?}");
}

#[test]
fn one_signal_ends_a_process_that_waits_for_a_plugin_before_a_run() {
    let scratch = Scratch::default();
    let (begun, file) = (scratch.path().join("begun"), scratch.path().display().to_string());
    let hangs = "IN_CREATE=fclose(fopen(\"begun\", \"w\")); hang();";
    let scene = scratch.file("scene.toml", scene_of(&scratch, HONEST, hangs, "")).display().to_string();
    let running = Flotor::with(["run", &scene]).inside(file.as_ref()).start();
    let started = Instant::now();
    while !begun.exists() && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(130), "{ran:?}");
}

#[test]
fn a_replacement_that_hangs_does_not_keep_a_host_alive() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let runtime = scratch.folder("runtime");
    let hanging = plugin_that(&scratch, "model", "IN_CREATE=hang();").display().to_string();
    let scene = scene_of(&scratch, HONEST, HONEST, "[limits]\nwatchdog_ms = 60000\n");
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join("run.mcap");
    let record = recording.display().to_string();
    let flotor =
        |arguments: &[&str]| Flotor::with(arguments).env("XDG_RUNTIME_DIR", &runtime.display().to_string());
    let running = flotor(&["run", &scene, "--duration", "4s", "--record", &record]).start();
    let started = Instant::now();
    while !holds_ticks(&recording) && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let swapping = flotor(&["swap", "jelly", "--plugin", &hanging]).start();
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("digest"), "{ran:?}");
    assert_ne!(swapping.wait().code, Some(exit_code::OK), "nothing was replaced");
}

// ---------------------------------------------------------------- processes of their own

/// The processes that are children of one.
fn children(of: u32) -> usize {
    let path = format!("/proc/{of}/task/{of}/children");
    std::fs::read_to_string(path).map_or(0, |list| list.split_whitespace().count())
        + std::fs::read_dir(format!("/proc/{of}/task")).map_or(0, |tasks| {
            let children = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("children"));
            let others = tasks.flatten().filter(|task| *task.file_name() != *of.to_string());
            others.filter_map(|task| children(task).ok()).map(|list| list.split_whitespace().count()).sum()
        })
}

#[test]
fn a_model_from_outside_runs_in_a_process_of_its_own_where_a_hand_is_and_only_there() {
    let scratch = Scratch::default();
    let scene = |device: &str, isolation: &str| {
        let model = plugin_that(&scratch, "model", HONEST);
        let device = match device {
            "real" => plugin_that(&scratch, "device", HONEST).display().to_string(),
            simulated => simulated.to_owned(),
        };
        let text = format!(
            "duration_s = 60\n[device]\nplugin = \"{device}\"\n[[model]]\nplugin = \"{}\"\n{isolation}\n\
             [limits]\nwatchdog_ms = 60000\n",
            model.display()
        );
        scratch.file("scene.toml", text).display().to_string()
    };
    let processes = |scene: &str| {
        let recording = scratch.path().join("run.mcap");
        let _ = std::fs::remove_file(&recording);
        let running = Flotor::with(["run", scene, "--record", &recording.display().to_string()]).start();
        let started = Instant::now();
        while !holds_ticks(&recording) && started.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(10));
        }
        children(running.host().as_raw_nonzero().get().cast_unsigned())
    };
    assert_eq!(processes(&scene("real", "")), 1, "from outside, and felt");
    assert_eq!(processes(&scene("real", "isolation = \"none\"")), 0, "the scene decides");
    assert_eq!(processes(&scene("simulated", "")), 0, "no hand");
    assert_eq!(processes(&scene("simulated", "isolation = \"process\"")), 1, "the scene decides");
    for (isolation, says) in [("", "), in a process of its own"), ("isolation = \"none\"", ")")] {
        let ran = Flotor::with(["run", &scene("real", isolation), "--duration", "50ms"]).run();
        let model = ran.stdout.lines().find(|line| line.starts_with("  model ")).expect("a summary");
        // On a busy machine its time in excess of the budget follows.
        let (_, rest) = model.split_once("libmodel_HONEST.so").expect("its file");
        assert_eq!(rest.split("  ").next(), Some(says), "{ran:#?}");
    }
}

#[test]
fn every_extension_works_in_a_process_of_its_own_with_the_same_bits() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let spring = "plugin = \"spring\"\n";
    let wall = "plugin = \"wall\"\n[model.parameters]\nshape = \"sphere\"\n";
    let membrane = "plugin = \"membrane\"\n[model.field]\nrate_hz = 200\n";
    for model in [spring, wall, membrane] {
        let forces = |isolation: &str| -> Vec<_> {
            let (plugin, tables) = model.split_once('\n').expect("two lines");
            let scene = format!(
                "duration_s = 1\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"press\"\n\
                 [[model]]\n{plugin}\nisolation = \"{isolation}\"\n{tables}"
            );
            watch(&scene)
                .records
                .iter()
                .map(|record| (record.pose, record.commanded, record.events))
                .collect()
        };
        let (here, there) = (forces("none"), forces("process"));
        assert_eq!(here, there, "{model}");
    }
}

// ---------------------------------------------------------------- the state of the machine

/// What a plugin may leave changed in the thread that calls it: it rounds up, flushes to zero, traps at what is invalid.
#[cfg(target_arch = "x86_64")]
const FLOAT_HABITS: [&str; 3] = [
    "IN_STEP=__builtin_ia32_ldmxcsr(0x5f80);",
    "IN_STEP=__builtin_ia32_ldmxcsr(0x9fc0);",
    "IN_STEP=__builtin_ia32_ldmxcsr(0x1900);",
];

#[cfg(target_arch = "x86_64")]
#[test]
fn a_model_that_rounds_otherwise_changes_no_other_number_and_is_named() {
    let scratch = Scratch::default();
    let run = |habit: &str, isolation: &str| {
        let model = plugin_that(&scratch, "model", habit);
        // It asks for nothing that depends on rounding where the handle is at rest; the spring and the plant do.
        let scene = format!(
            "duration_s = 1\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n[[model]]\nname = \"jelly\"\n\
             plugin = \"{}\"\n{isolation}\n[model.blend]\nweight = 1e-300\n",
            model.display()
        );
        watch(&scene)
    };
    let honest = run(HONEST, "");
    let forces = |run: &flotor_tests::watched::Watched| -> Vec<_> {
        run.records.iter().map(|record| (record.pose, record.commanded)).collect()
    };
    for habit in FLOAT_HABITS {
        for isolation in ["", "isolation = \"process\""] {
            let changed = run(habit, isolation);
            assert_eq!(forces(&changed), forces(&honest), "{habit} {isolation}");
        }
        let told = run(habit, "");
        let health = told.outcome.models[1].1;
        assert_eq!(health.float_changes.first, Some(0), "{habit}: {health:?}");
        assert!(told.outcome.models[0].1.is_good(), "the spring is not blamed");
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn a_device_that_rounds_otherwise_changes_no_number_and_is_named() {
    let scratch = Scratch::default();
    for clock in ["virtual", "real"] {
        let habit = "IN_READ=__builtin_ia32_ldmxcsr(0x5f80);";
        let more = "[limits]\nwatchdog_ms = 60000\n";
        let ran = run(&scratch, &scene_of(&scratch, habit, HONEST, more), clock);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
        let summary = summary(&scratch);
        assert!(summary["events"]["float_environment"].as_u64() > Some(100), "{summary}");
        let health = summary["plugins"][0]["health"].as_str().unwrap_or_default();
        assert!(health.contains("floating-point environment"), "{health}");
    }
}

#[test]
fn what_a_plugin_changes_of_the_process_while_it_is_made_is_put_back_and_named() {
    let folder = "IN_CREATE=if (chdir(\"/\")) { abort(); }";
    let files = "IN_CREATE=struct rlimit few; getrlimit(RLIMIT_NOFILE, &few); few.rlim_cur = 64; setrlimit(RLIMIT_NOFILE, &few);";
    let cores = "IN_PREPARE=cpu_set_t one; CPU_ZERO(&one); CPU_SET(0, &one); sched_setaffinity(getpid(), sizeof one, &one);";
    let nice = "IN_PREPARE=setpriority(PRIO_PROCESS, getpid(), 19);";
    let mask = "IN_CREATE=umask(0777);";
    let locale = "IN_PREPARE=if (!setlocale(LC_ALL, \"C.UTF-8\")) { abort(); }";
    for (habit, what) in [
        (mask, "the mode mask of new files"),
        (locale, "the locale"),
        (folder, "the working folder"),
        (files, "the limit of open files"),
        (cores, "the cores of the main thread"),
        (nice, "the priority of the main thread"),
    ] {
        let scratch = Scratch::default();
        let ran = run(&scratch, &scene_of(&scratch, HONEST, habit, ""), "virtual");
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let told = format!(
            "note: `jelly` changed {what} of the host, which the host restored as far as permitted\n"
        );
        assert!(ran.stderr.starts_with(&told), "{ran:?}");
    }
}

#[test]
fn variables_that_a_plugin_changes_are_named() {
    let scratch = Scratch::default();
    let habit = "IN_CREATE=setenv(\"TZ\", \"Pacific/Kiritimati\", 1); umask(0777);";
    let ran = run(&scratch, &scene_of(&scratch, HONEST, habit, ""), "virtual");
    let told = "note: `jelly` changed the mode mask of new files of the host, which the host restored as far as permitted; the plugin also changed environment variables \
                of the host (TZ), which the host does not restore\n";
    assert!(ran.stderr.starts_with(told), "{ran:?}");
}

/// What software of makers does when it starts, in one model, and what the next model finds: numbers with a point, files that can be read,
/// the folder of the host.
#[test]
fn a_model_finds_the_process_as_it_was_before_another_changed_it() {
    let moves = "IN_CREATE=if (chdir(\"/\")) { abort(); } umask(0777); setenv(\"TZ\", \"Pacific/Kiritimati\", 1); \
                 if (!setlocale(LC_ALL, \"de_DE.UTF-8\") && !setlocale(LC_ALL, \"C.UTF-8\")) { abort(); }";
    let asks = "IN_CREATE=char folder[1000]; mode_t mask = umask(0); umask(mask); fprintf(stderr, \
                \"%o %s %g %g %s\\n\", (unsigned)mask, setlocale(LC_ALL, NULL), 0.5, strtod(\"0.5\", NULL), \
                getcwd(folder, sizeof folder) ? folder : \"-\");";
    let scratch = Scratch::default();
    let second = format!(
        "isolation = \"none\"\n[[model]]\nname = \"asks\"\nplugin = \"{}\"\nisolation = \"none\"\n",
        plugin_that(&scratch, "model", asks).display()
    );
    let scene = scratch.file("scene.toml", scene_of(&scratch, HONEST, moves, &second)).display().to_string();
    let names = ["run.mcap", "run.json", "run.svg"];
    let [recording, json, plot] = names.map(|name| scratch.path().join(name).display().to_string());
    let arguments =
        ["run", &scene, "--clock", "virtual", "--record", &recording, "--json", &json, "--plot", &plot];
    let ran = Flotor::with(arguments).through_shell("umask 027; exec \"$@\"").inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let found = format!("27 C 0.5 0.5 {}", scratch.path().display());
    assert!(ran.stderr.lines().any(|line| line == found), "{found}: {ran:?}");
    for name in names {
        let attributes = std::fs::metadata(scratch.path().join(name)).expect("the run wrote it");
        assert_eq!(attributes.permissions().mode() & 0o777, 0o640, "{name}");
    }
}

/// Thread-local data of a plugin, as allocators and OpenMP have it, takes room that no swap gives back: each swap to another build succeeds or
/// is refused with that cause, and the run goes on.
#[test]
fn rebuilt_plugins_with_thread_local_data_are_swapped_until_the_room_is_used_up() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let runtime = scratch.folder("runtime").display().to_string();
    let library = scratch.path().join("libbuilt.so");
    let build = |number: usize| {
        let step = "IN_STEP=static __thread __attribute__((tls_model(\"initial-exec\"))) char block[200]; block[3]++;";
        let create = format!("IN_CREATE=static volatile int build = {number}; build++;");
        let new = scratch.path().join("new.so");
        compile_c_file(&workspace_root().join("tests/c/model_that.c"), &[step, &create], &new);
        std::fs::rename(new, &library).expect("both are in one folder");
    };
    build(0);
    let scene =
        scene_of(&scratch, HONEST, HONEST, "[model.blend]\nfade_s = 0.01\n[limits]\nwatchdog_ms = 60000\n");
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join("run.mcap");
    let record = recording.display().to_string();
    let flotor = |arguments: &[&str]| Flotor::with(arguments).env("XDG_RUNTIME_DIR", &runtime);
    let running = flotor(&["run", &scene, "--duration", "600s", "--record", &record]).start();
    let started = Instant::now();
    while !holds_ticks(&recording) && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let path = library.display().to_string();
    let swaps = (1..40).map(|number| {
        build(number);
        let mut ran = flotor(&["swap", "jelly", "--plugin", &path]).run();
        while ran.stderr.contains("still fading") {
            ran = flotor(&["swap", "jelly", "--plugin", &path]).run();
        }
        ran
    });
    let refused = swaps.into_iter().find(|ran| ran.code != Some(exit_code::OK)).expect("the room has an end");
    assert_eq!(refused.code, Some(exit_code::PLUGIN_REFUSED), "{refused:?}");
    for part in ["[jelly] model unchanged: ", "static TLS", "optional_static_tls=16384"] {
        assert!(refused.error().contains(part), "{part}: {refused:?}");
    }
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("digest"), "{ran:?}");
}

// ---------------------------------------------------------------- files

#[test]
fn poses_that_are_not_text_are_refused_with_their_line() {
    let scratch = Scratch::default();
    let header = b"x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,0,0,0,0\n".to_vec();
    let poses = scratch.file("poses.csv", [header, b"0,0,\xff,0,0,0\n".to_vec()].concat());
    let poses = poses.display().to_string();
    let ran = Flotor::with(["eval", "--model", "spring", "--poses", &poses, "--out", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().starts_with(&format!("{poses}:3: ")), "{ran:?}");
}
