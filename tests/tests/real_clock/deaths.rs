//! A process that dies takes the force along: seen from a board that keeps its last torque for ever, in its own log.

use crate::board::{
    Board, FELT_N, PAST, PATIENT, Where, children_of, dies, mark_in, recorded_ticks, run_on, run_with,
    wait_until,
};
use crate::post::Post;
use flotor_tests::TestSize;
use flotor_tests::program::{Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use flotor_tests::tools::{Tool, required};
use flotor_tests::workspace_root;
use rustix::process::{Signal, kill_process, test_kill_process};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// How long force may stay after its host, on a machine that is loaded; milliseconds on one that has nothing else to do.
const LONGEST: Duration = Duration::from_secs(2);

/// What a host says that dies and stops its devices.
const HELD: &str = "every device was commanded to stop";

/// Runs the model that dies so to the end of the process: the board is at rest then.
fn died(death: &str, model: &Path) -> (Board, Scratch, Ran) {
    let (board, scratch) = (Board::start(), Scratch::default());
    let ran = run_on(&board, &scratch, model, Where::InTheHost).env("FIXTURE_DEATH", death).run();
    let after = board.assert_stopped(death);
    println!("{death}: no force {after:?} after the last request for one");
    assert!(after < LONGEST, "{death}: {after:?}");
    (board, scratch, ran)
}

/// All of them at full size, else those whose ways out of the process differ most.
fn of_this_size<T: Copy>(cases: &[(T, TestSize)]) -> Vec<T> {
    let size = TestSize::of_this_run();
    cases.iter().filter(|(_, least)| *least <= size).map(|(case, _)| *case).collect()
}

#[test]
fn without_a_death_the_force_stays() {
    let _turn = crate::alone();
    let (board, scratch) = (Board::start(), Scratch::default());
    let running = run_on(&board, &scratch, dies(), Where::InTheHost).start();
    board.wait_for_force(PAST);
    assert!(board.force_n() > FELT_N, "{:?}", board.log());
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let _ = board.assert_stopped("the end");
}

#[test]
fn a_death_that_can_be_caught_takes_the_force_along() {
    use TestSize::{Full, Quick};
    let _turn = crate::alone();
    let deaths = of_this_size(&[
        (("segv", "SIGSEGV"), Quick),
        (("overflow", "SIGSEGV"), Quick),
        (("bus", "SIGBUS"), Full),
        (("fpe", "SIGFPE"), Full),
        (("ill", "SIGILL"), Full),
        (("abort", "SIGABRT"), Quick),
        (("xcpu", "SIGXCPU"), Full),
        (("usr2", "SIGUSR2"), Full),
        (("alrm", "SIGALRM"), Quick),
        (("pthread-exit", ""), Quick),
        (("exit", "it called `exit`"), Quick),
        (("thread-exit", "it called `exit`"), Quick),
    ]);
    show_each(&deaths, |(death, words)| {
        let (_board, scratch, ran) = died(death, dies());
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{death}: {ran:?}");
        let line = ran.stderr.lines().find(|line| line.contains(HELD));
        let line = line.unwrap_or_else(|| panic!("{death}: nobody says what happened: {ran:?}"));
        for expected in ["error: ", "`culprit`", "`step`", "tick 4", words] {
            assert!(line.contains(expected), "{death}: {expected}: {ran:?}");
        }
        assert!(recorded_ticks(&scratch) > 0, "{death}");
    });
}

#[test]
fn an_exception_in_cpp_that_nobody_catches_takes_the_force_along() {
    if !required(Tool::Cxx) {
        return;
    }
    let _turn = crate::alone();
    let scratch = Scratch::default();
    let source =
        std::fs::read_to_string(workspace_root().join("examples/model-cpp/jelly.cpp")).expect("a source");
    let first_line = "output = FlotorOutput{};\n";
    assert!(source.contains(first_line), "{source}");
    let throws =
        source.replacen(first_line, "if (input.tick >= 300) { throw 1; }\noutput = FlotorOutput{};\n", 1);
    let library = scratch.path().join("libthrows.so");
    let compiled = Command::new("c++")
        .args(["-std=c++17", "-O1", "-shared", "-fPIC", "-I"])
        .arg(workspace_root().join("hal/include"))
        .arg(scratch.file("throws.cpp", throws))
        .arg("-o")
        .arg(&library)
        .output()
        .expect("it was there just now");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let (_board, _scratch, ran) = died("throw", &library);
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    let line = ran.stderr.lines().find(|line| line.contains(HELD)).unwrap_or_default();
    assert!(line.contains("`culprit` ended the process in `step`, tick 300"), "{ran:?}");
}

#[test]
fn a_death_that_cannot_be_caught_leaves_it_to_the_watchdog_process() {
    let _turn = crate::alone();
    let refused = exit_code::PLUGIN_REFUSED;
    let deaths = [
        ("_exit", refused, "exit code 0"),
        ("exec", refused, "exit code 0"),
        ("kill", exit_code::OTHER, "SIGKILL"),
    ];
    show_each(&deaths, |(death, code, words)| {
        let (_board, scratch, ran) = died(death, dies());
        assert_eq!(ran.code, Some(*code), "{death}: {ran:?}");
        let is_named = |line: &str| line.starts_with("error: ") && line.contains(words);
        assert!(ran.stderr.lines().any(is_named), "{death}: {ran:?}");
        let told = "flotor watchdog: the host has ended; stopped `device`";
        assert!(ran.stderr.lines().any(|line| line == told), "{death}: {ran:?}");
        assert!(recorded_ticks(&scratch) > 0, "{death}");
    });
}

#[test]
fn a_host_that_is_killed_from_outside_leaves_no_force_and_no_process_behind() {
    let _turn = crate::alone();
    show_each(&[(Where::InTheHost, 1), (Where::InAProcess, 2)], |(place, processes)| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, dies(), *place);
        let running = run.env("FIXTURE_DEATH", "loop-in-step").start();
        wait_until("the model loops", || mark_in(&scratch).exists());
        let children = children_of(running.host());
        assert_eq!(children.len(), *processes, "{children:?}");
        running.signal_host(Signal::KILL);
        let ran = running.wait();
        assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:?}");
        assert!(ran.stderr.contains("error: signal 9 (SIGKILL"), "{ran:?}");
        let _ = board.assert_stopped("killed");
        for child in children {
            wait_until("its processes are gone", || test_kill_process(child).is_err());
        }
    });
}

#[test]
fn a_calibration_that_is_killed_leaves_no_force() {
    let _turn = crate::alone();
    let post = Post::new();
    let calibration = post.calibration();
    let running = post.flotor(&calibration.iter().map(String::as_str).collect::<Vec<_>>()).start();
    post.wait_for_force(0);
    running.signal_host(Signal::KILL);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:?}");
    assert!(ran.stderr.contains("flotor watchdog: the host has ended; stopped `fixture-c-post`"), "{ran:?}");
    let _ = post.assert_stopped("the calibration is killed");
}

#[test]
fn a_supervisor_that_is_killed_takes_the_run_along() {
    let _turn = crate::alone();
    show_each(&["none", "loop-in-step"], |death| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let running = run_on(&board, &scratch, dies(), Where::InTheHost).env("FIXTURE_DEATH", death).start();
        match *death {
            "none" => board.wait_for_force(PAST),
            _ => wait_until("the model loops", || mark_in(&scratch).exists()),
        }
        let host = running.host();
        let processes = [children_of(host), vec![host]].concat();
        assert_eq!(processes.len(), 2, "the host and its watchdog process: {processes:?}");
        running.signal(Signal::KILL);
        assert_eq!(running.wait().code, None, "{death}");
        let _ = board.assert_stopped(death);
        for process in processes {
            wait_until("its processes are gone", || test_kill_process(process).is_err());
        }
    });
}

#[test]
fn a_model_in_a_process_of_its_own_dies_alone() {
    use TestSize::{Full, Quick};
    let _turn = crate::alone();
    let deaths = of_this_size(&[
        ("segv", Quick),
        ("overflow", Full),
        ("abort", Full),
        ("exit", Full),
        ("thread-exit", Quick),
        ("pthread-exit", Quick),
        ("_exit", Quick),
        ("exec", Full),
        ("kill", Full),
    ]);
    show_each(&deaths, |death| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, dies(), Where::InAProcess);
        let running = run.env("FIXTURE_DEATH", death).start();
        board.wait_for_force(0);
        // The host goes on without force, and is told to end.
        wait_until(&format!("{death}: the host has lost it"), || children_of(running.host()).len() == 1);
        wait_until(&format!("{death}: the force is gone"), || board.force_n() == 0.0);
        running.signal(Signal::INT);
        let ran = running.wait();
        let _ = board.assert_stopped(death);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{death}: {ran:?}");
        let named = |line: &str| line.starts_with("error: ") && line.contains("`culprit`");
        assert!(ran.stderr.lines().any(named), "{death}: {ran:?}");
        assert!(!ran.stderr.contains(HELD), "{death}: the host has not died: {ran:?}");
    });
}

#[test]
fn a_host_notices_that_its_watchdog_process_is_gone() {
    let _turn = crate::alone();
    let gone = "the watchdog process has ended, so no process stops the devices if this program is killed";
    show_each(&["require_independent_stop = true", ""], |limits| {
        let (board, scratch) = (Board::start(), Scratch::default());
        let lines = format!("{PATIENT}\n{limits}");
        let running = run_with(&board, &scratch, dies(), Where::InTheHost, &lines).start();
        board.wait_for_force(0);
        let watchdog = children_of(running.host());
        assert_eq!(watchdog.len(), 1, "{watchdog:?}");
        let _ = kill_process(watchdog[0], Signal::KILL);
        let before = board.log().len();
        if limits.is_empty() {
            board.wait_for_force(before + PAST);
            running.signal(Signal::INT);
        }
        let ran = running.wait();
        let _ = board.assert_stopped("the end");
        let told = ran.stderr.lines().filter(|line| line.contains(gone));
        let expected =
            if limits.is_empty() { ("note: ", exit_code::OK) } else { ("error: ", exit_code::OTHER) };
        assert_eq!(ran.code, Some(expected.1), "{ran:?}");
        assert_eq!(told.filter(|line| line.starts_with(expected.0)).count(), 1, "{ran:?}");
    });
}

#[test]
fn a_device_that_nothing_stops_is_named_and_refused_where_the_scene_requires_a_stop() {
    let _turn = crate::alone();
    let scratch = Scratch::default();
    let library = scratch.path().join("libpost.so");
    flotor_tests::library::compile_c_file(&workspace_root().join("tests/c/post.c"), &[], &library);
    let scene = format!("duration_s = 0.2\n[device]\nplugin = \"{}\"\n", library.display());
    let run = |scene: String| {
        let file = scratch.file("scene.toml", scene);
        flotor_tests::program::Flotor::with(["run".as_ref(), file.as_os_str()]).run()
    };
    let ran = run(format!("{scene}[limits]\nwatchdog_ms = 60000\n"));
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stderr.contains("note: nothing stops `device` if this program is killed"), "{ran:?}");
    let ran = run(format!("{scene}[limits]\nrequire_independent_stop = true\n"));
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("`[limits] require_independent_stop`"), "{ran:?}");
    let ran = run(format!("{scene}[limits]\nrequire_independent_stop = \"yes\"\n"));
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("`limits.require_independent_stop` must be true or false"), "{ran:?}");
}

#[test]
fn a_study_names_a_device_that_nothing_stops_and_takes_the_consent_to_a_shared_control_group() {
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let library = scratch.path().join("libpost.so");
    flotor_tests::library::compile_c_file(&workspace_root().join("tests/c/post.c"), &[], &library);
    let scene = format!(
        "[device]\nplugin = \"{}\"\n[[model]]\nplugin = \"spring\"\n[[model]].parameters\nmode = \"gamma\"\n",
        library.display()
    )
    .replace("[[model]].parameters", "[model.parameters]");
    let scene = scratch.file("study.toml", scene).display().to_string();
    let data = scratch.path().join("data").display().to_string();
    let consent = "--accept-shared-control-group";
    let explore = ["study", "explore", "--scene", &scene, consent];
    let sit = [
        "study",
        "jnd",
        "--observer",
        "human",
        "--screen",
        "terminal",
        "--noise=off",
        "--no-demo",
        "--scene",
        &scene,
        "--out",
        &data,
        consent,
    ];
    for arguments in [&explore[..], &sit[..]] {
        let ran = flotor_tests::program::Flotor::with(arguments).reading("q\n").run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        assert!(ran.stderr.contains("note: nothing stops `device` if this program is killed"), "{ran:?}");
    }
}
