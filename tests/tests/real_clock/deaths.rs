//! A process that dies takes the force along, and signals stay the host's: seen from a board that keeps its last torque for
//! ever (the emulated Haply board), in its own log.

use flotor_hal::glam::DVec2;
use flotor_haply::emulator::EmulatedBoard;
use flotor_haply::pantograph::Pantograph;
use flotor_record::Recording;
use flotor_tests::holds_ticks;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use flotor_tests::workspace_root;
use rustix::process::{Pid, Signal, test_kill_process};
use serialport::{SerialPort, TTYPort};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const LINKAGE: Pantograph = Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 };
/// The hand holds the handle 5 mm and 4 mm from home: the spring of 200 N/m pulls with 1.28 N.
const HELD_M: DVec2 = DVec2::new(0.014, 0.096);
/// Less than a fifth of that: there was force.
const FELT_N: f64 = 0.25;
/// How long force may stay after its host, on a machine that is loaded.
const LONGEST: Duration = Duration::from_secs(2);
/// How long anything here may take: a machine on which nothing moves for a while is no failure.
const PATIENCE: Duration = Duration::from_secs(30);

// ---------------------------------------------------------------- the board and its log

/// Force on the hand after each look at what the host has sent, N, and when.
type Log = Arc<Mutex<Vec<(Instant, f64)>>>;

/// A board on a thread of its own, until it is dropped. It outlives the host.
struct Board {
    path: String,
    log: Log,
    is_over: Arc<AtomicBool>,
}

impl Board {
    fn start() -> Self {
        let (mut port, host_end) = TTYPort::pair().expect("the system has pseudo terminals");
        port.set_timeout(Duration::from_millis(5)).expect("it is ours");
        let path = host_end.name().expect("it has a path");
        let (log, is_over) = (Log::default(), Arc::new(AtomicBool::new(false)));
        let (entries, ended) = (Arc::clone(&log), Arc::clone(&is_over));
        std::thread::spawn(move || {
            let _host_end = host_end; // open as long as the board is: a host that goes does not unplug it
            let mut board = EmulatedBoard::new(LINKAGE, HELD_M);
            let mut chunk = [0; 256];
            while !ended.load(Ordering::Acquire) {
                let length = port.read(&mut chunk).unwrap_or(0);
                if length == 0 {
                    continue;
                }
                let answer = board.hear(&chunk[..length]);
                let force_n = board.force_n().map_or(0.0, DVec2::length);
                entries.lock().unwrap_or_else(PoisonError::into_inner).push((Instant::now(), force_n));
                let _ = port.write_all(&answer);
            }
        });
        Self { path, log, is_over }
    }

    fn log(&self) -> MutexGuard<'_, Vec<(Instant, f64)>> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn force_n(&self) -> f64 {
        self.log().last().map_or(0.0, |(_, force_n)| *force_n)
    }

    fn wait_for_force(&self) {
        wait_until("there is force", || self.force_n() > FELT_N);
    }

    /// There was force, and there is none any more: time from the last request with force to the first without.
    fn assert_stopped(&self, what: &str) -> Duration {
        wait_until(&format!("{what}: the board is at rest"), || self.force_n() == 0.0);
        let log = self.log();
        let felt = log.iter().rposition(|(_, force_n)| *force_n > 0.0);
        let most_n = log.iter().map(|(_, force_n)| *force_n).fold(0.0, f64::max);
        assert!(most_n > FELT_N, "{what}: there was no force that could be taken away: {most_n} N");
        let felt = felt.expect("there was some");
        log[felt + 1].0.duration_since(log[felt].0)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
    }
}

fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

// ---------------------------------------------------------------- runs

/// The fixture that dies, made once.
fn dies(scratch: &Scratch) -> PathBuf {
    let library = scratch.path().join("libdies.so");
    if !library.exists() {
        compile_c_file(&workspace_root().join("tests/c/dies.c"), &[], &library);
    }
    library
}

/// A run of a model on a board for longer than any test waits, recorded.
fn run_on(board: &Board, scratch: &Scratch, model: &Path, tables: &str) -> Flotor {
    let scene = format!(
        "rate_hz = 500\nduration_s = 120\n[device]\nplugin = \"haply\"\n[device.parameters]\nport = \"{}\"\n\
         timeout_ms = 9000\n[[model]]\nplugin = \"{}\"\nname = \"culprit\"\n{tables}\n\
         [limits]\nforce_n = [3, 3, 0]\nwatchdog_ms = 60000\nramp_s = 0.05\nrequire_independent_stop = true\n",
        board.path,
        model.display(),
    );
    let scene = scratch.file("scene.toml", scene);
    let recording = recording_in(scratch);
    let arguments: [&OsStr; 4] = ["run".as_ref(), scene.as_ref(), "--record".as_ref(), recording.as_ref()];
    Flotor::with(arguments)
}

fn recording_in(scratch: &Scratch) -> PathBuf {
    scratch.path().join("run.mcap")
}

/// Ticks of a recording that nobody finished, up to its last chunk.
fn recorded_ticks(scratch: &Scratch) -> usize {
    let recording = Recording::open(&recording_in(scratch)).expect("it can be read");
    recording.inspect(|record| assert!(record.is_ok(), "whole up to its last chunk")).count()
}

/// Runs the fixture that dies so to the end of the process: the board is at rest then.
fn died(death: &str, tables: &str) -> (Board, Scratch, Ran) {
    let (board, scratch) = (Board::start(), Scratch::default());
    let run = run_on(&board, &scratch, &dies(&scratch), tables);
    let ran = run.env("FIXTURE_DEATH", death).run();
    let after = board.assert_stopped(death);
    println!("{death}: no force {after:?} after the last request for one");
    // Some milliseconds on a machine that has nothing else to do.
    assert!(after < LONGEST, "{death}: {after:?}");
    (board, scratch, ran)
}

const HELD: &str = "every device was told to stop";

#[test]
fn without_a_death_the_force_stays() {
    let _turn = crate::alone();
    let (board, scratch) = (Board::start(), Scratch::default());
    let running = run_on(&board, &scratch, &dies(&scratch), "").start();
    board.wait_for_force();
    wait_until("the tick is past in which others die", || recorded(&scratch) > 500);
    assert!(board.force_n() > FELT_N, "{:?}", board.log());
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let _ = board.assert_stopped("the end");
}

/// Ticks so far of a recording that is being written.
fn recorded(scratch: &Scratch) -> usize {
    let file = recording_in(scratch);
    if holds_ticks(&file) { recorded_ticks(scratch) } else { 0 }
}

#[test]
fn a_death_that_can_be_caught_takes_the_force_along() {
    let _turn = crate::alone();
    for (death, words) in [
        ("segv", "SIGSEGV"),
        ("overflow", "SIGSEGV"),
        ("bus", "SIGBUS"),
        ("fpe", "SIGFPE"),
        ("ill", "SIGILL"),
        ("abort", "SIGABRT"),
        ("xcpu", "SIGXCPU"),
        ("usr2", "SIGUSR2"),
        ("alrm", "SIGALRM"),
        ("pthread-exit", ""),
        ("exit", "it called `exit`"),
        ("thread-exit", "it called `exit`"),
    ] {
        let (_board, scratch, ran) = died(death, "");
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{death}: {ran:?}");
        let line = ran.stderr.lines().find(|line| line.contains(HELD));
        let line = line.unwrap_or_else(|| panic!("{death}: nobody says what happened: {ran:?}"));
        for expected in ["error: ", "`culprit`", "`step`", "tick 3", words] {
            assert!(line.contains(expected), "{death}: {expected}: {ran:?}");
        }
        assert!(recorded_ticks(&scratch) > 0, "{death}");
    }
}

#[test]
fn an_exception_in_cpp_that_nobody_catches_takes_the_force_along() {
    if !required(Tool::Cxx) {
        return;
    }
    let _turn = crate::alone();
    let (board, scratch) = (Board::start(), Scratch::default());
    let library = scratch.path().join("libthrows.so");
    let compiled = Command::new("c++")
        .args(["-std=c++17", "-DTHROWS", "-O1", "-shared", "-fPIC", "-I"])
        .arg(workspace_root().join("hal/include"))
        .arg(workspace_root().join("tests/cpp/jelly.cpp"))
        .arg("-o")
        .arg(&library)
        .output()
        .expect("it was there just now");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let ran = run_on(&board, &scratch, &library, "").run();
    let after = board.assert_stopped("throw");
    assert!(after < LONGEST, "{after:?}");
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    let line = ran.stderr.lines().find(|line| line.contains(HELD)).unwrap_or_default();
    assert!(line.contains("`culprit` ended the process in `step`, tick 300"), "{ran:?}");
}

#[test]
fn a_death_that_cannot_be_caught_leaves_it_to_the_watchdog_process() {
    let _turn = crate::alone();
    for (death, code) in [("_exit", Some(0)), ("exec", Some(0)), ("kill", None)] {
        let (_board, scratch, ran) = died(death, "");
        assert_eq!(ran.code, code, "{death}: {ran:?}");
        let told = "flotor watchdog: the host is gone; stopped `device`";
        assert!(ran.stderr.lines().any(|line| line == told), "{death}: {ran:?}");
        assert!(recorded_ticks(&scratch) > 0, "{death}");
    }
}

#[test]
fn a_host_that_is_killed_from_outside_leaves_no_force_and_no_process_behind() {
    let _turn = crate::alone();
    for tables in ["", "isolation = \"process\""] {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, &dies(&scratch), tables);
        let running = run.env("FIXTURE_DEATH", "loop-in-step").start();
        board.wait_for_force();
        wait_until("the model loops", || is_in_the_fixture(running.pid(), tables.is_empty()));
        let children = children_of(running.pid());
        assert_eq!(children.len(), if tables.is_empty() { 1 } else { 2 }, "{children:?}");
        running.signal(Signal::KILL);
        let ran = running.wait();
        assert_eq!(ran.code, None, "{ran:?}");
        let _ = board.assert_stopped("killed");
        for child in children {
            wait_until("its processes are gone", || test_kill_process(child).is_err());
        }
    }
}

/// The processes a process has started.
fn children_of(parent: Pid) -> Vec<Pid> {
    let is_child = |status: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix("PPid:"));
        line.is_some_and(|number| number.trim() == parent.as_raw_nonzero().to_string())
    };
    let processes = std::fs::read_dir("/proc").expect("Linux has it").filter_map(Result::ok);
    let numbers = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let children = numbers.filter(|number| {
        std::fs::read_to_string(format!("/proc/{number}/status")).is_ok_and(|status| is_child(&status))
    });
    children.filter_map(Pid::from_raw).collect()
}

#[test]
fn a_model_in_a_process_of_its_own_dies_alone() {
    let _turn = crate::alone();
    for death in ["segv", "overflow", "abort", "exit", "thread-exit", "pthread-exit", "_exit", "exec", "kill"]
    {
        let (_board, _scratch, ran) = died_alone(death);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{death}: {ran:?}");
        let named = |line: &str| line.starts_with("error: ") && line.contains("`culprit`");
        assert!(ran.stderr.lines().any(named), "{death}: {ran:?}");
        assert!(!ran.stderr.contains(HELD), "{death}: the host has not died: {ran:?}");
    }
}

/// As [`died`], in a process of its own: the host goes on without force, and is told to end.
fn died_alone(death: &str) -> (Board, Scratch, Ran) {
    let (board, scratch) = (Board::start(), Scratch::default());
    let run = run_on(&board, &scratch, &dies(&scratch), "isolation = \"process\"\nbudget_us = 1e5");
    let running = run.env("FIXTURE_DEATH", death).start();
    board.wait_for_force();
    wait_until(&format!("{death}: the host has lost it"), || children_of(running.pid()).len() == 1);
    wait_until(&format!("{death}: the force is gone"), || board.force_n() == 0.0);
    running.signal(Signal::INT);
    let ran = running.wait();
    let _ = board.assert_stopped(death);
    (board, scratch, ran)
}

#[test]
fn signals_stay_the_hosts_whatever_a_plugin_does() {
    let _turn = crate::alone();
    for taking in ["handlers-in-create", "blocks-in-create", "handlers-in-step"] {
        for (signal, code) in [
            (Signal::INT, exit_code::OK),
            (Signal::TERM, exit_code::OK),
            (Signal::USR1, exit_code::DEVICE_FAULT),
        ] {
            let (board, scratch) = (Board::start(), Scratch::default());
            let run = run_on(&board, &scratch, &dies(&scratch), "");
            let running = run.env("FIXTURE_DEATH", taking).start();
            board.wait_for_force();
            // Beyond the tick in which a step takes them, and the next look of the watchdog.
            wait_until("the signals are taken", || recorded(&scratch) > 500);
            running.signal(signal);
            let ran = running.wait();
            assert_eq!(ran.code, Some(code), "{taking}, {signal:?}: {ran:?}");
            let _ = board.assert_stopped(taking);
            let who = if taking.ends_with("create") { "`culprit` took " } else { "a plugin took " };
            let notes: Vec<&str> = ran.stderr.lines().filter(|line| line.starts_with("note: ")).collect();
            // What was blocked before stays so: it is waited for.
            let what = if taking == "blocks-in-create" { "SIGSEGV" } else { "SIGINT, SIGTERM" };
            let named = |line: &&&str| line.contains(who) && line.contains(what);
            assert_eq!(notes.iter().filter(named).count(), 1, "{taking}, {signal:?}: {ran:?}");
            let warned = ran.stdout.lines().any(|line| line.contains("warning") && line.contains(who));
            assert!(warned, "{taking}, {signal:?}: {ran:?}");
        }
    }
}

#[test]
fn before_anything_is_energised_the_first_signal_ends_the_process() {
    let _turn = crate::alone();
    for tables in ["", "isolation = \"process\""] {
        let (board, scratch) = (Board::start(), Scratch::default());
        let run = run_on(&board, &scratch, &dies(&scratch), tables);
        let running = run.env("FIXTURE_DEATH", "loop-in-create").start();
        wait_until("the model is being made", || is_in_the_fixture(running.pid(), tables.is_empty()));
        let children = children_of(running.pid());
        running.signal(Signal::INT);
        let ran = running.wait();
        assert_eq!(ran.code, Some(130), "{ran:?}");
        for child in children {
            wait_until("its worker is gone", || test_kill_process(child).is_err());
        }
    }
}

#[test]
fn after_a_second_signal_nothing_holds_the_process_for_long() {
    let _turn = crate::alone();
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 60\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"{}\"\n",
        dies(&scratch).display()
    );
    let scene = scratch.file("scene.toml", scene);
    // On the virtual clock nobody watches the loop: it hangs for good.
    let run = Flotor::with(["run".as_ref(), scene.as_os_str(), "--clock".as_ref(), "virtual".as_ref()]);
    let running = run.env("FIXTURE_DEATH", "loop-in-step").start();
    wait_until("the model loops", || is_in_the_fixture(running.pid(), true));
    running.signal(Signal::INT);
    std::thread::sleep(Duration::from_millis(500)); // another request
    running.signal(Signal::INT);
    assert_eq!(running.wait().code, Some(130));
}

/// Whether the library of the fixture is loaded where its model is made: in the host, or in its worker. Then it loops at once.
fn is_in_the_fixture(host: Pid, in_the_host: bool) -> bool {
    let who = if in_the_host { vec![host] } else { children_of(host) };
    let burns = |process: &Pid| {
        let number = process.as_raw_nonzero();
        let times = std::fs::read_to_string(format!("/proc/{number}/stat")).unwrap_or_default();
        let times: Vec<&str> = times.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
        // Time in user mode, in hundredths of a second: a loop burns it, loading does not.
        times.get(11).and_then(|ticks| ticks.parse::<u64>().ok()).is_some_and(|ticks| ticks > 50)
    };
    who.iter().any(burns)
}

#[test]
fn a_device_that_nothing_stops_is_named_and_refused_where_the_scene_requires_a_stop() {
    let _turn = crate::alone();
    let scratch = Scratch::default();
    let library = scratch.path().join("libpost.so");
    compile_c_file(&workspace_root().join("tests/c/post.c"), &[], &library);
    let scene = format!("duration_s = 0.2\n[device]\nplugin = \"{}\"\n", library.display());
    let run = |scene: String| {
        let file = scratch.file("scene.toml", scene);
        Flotor::with(["run".as_ref(), file.as_os_str()]).run()
    };
    let ran = run(format!("{scene}[limits]\nwatchdog_ms = 60000\n"));
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stderr.contains("note: nothing stops `device` if this program is killed"), "{ran:?}");
    let ran = run(format!("{scene}[limits]\nrequire_independent_stop = true\n"));
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("`[limits] require_independent_stop`"), "{ran:?}");
    let ran = run(format!("{scene}[limits]\nrequire_independent_stop = \"yes\"\n"));
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("`limits.require_independent_stop` is true or false"), "{ran:?}");
}
