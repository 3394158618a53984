//! A board that keeps its last torque for ever (the emulated Haply board), and runs on it with a model that dies
//! or takes signals away (`tests/c/dies.c`).

use crate::force_log::ForceLog;
pub(crate) use crate::force_log::{FELT_N, wait_until};
use flotor_hal::glam::DVec2;
use flotor_haply::emulator::EmulatedBoard;
use flotor_haply::pantograph::Pantograph;
use flotor_record::Recording;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use flotor_tests::workspace_root;
use rustix::process::Pid;
use serialport::{SerialPort, TTYPort};
use std::ffi::OsStr;
use std::fs::Permissions;
use std::io::{Read, Write};
use std::ops::Deref;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

const LINKAGE: Pantograph = Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 };
/// The hand holds the handle 5 mm and 4 mm from home: the spring of 200 N/m pulls with 1.28 N.
const HELD_M: DVec2 = DVec2::new(0.014, 0.096);
/// Requests of a host that is past the tick in which the fixture does what it does, and the next look of its watchdog.
pub(crate) const PAST: usize = 600;
/// A board on a thread of its own, until it is dropped. It outlives the host.
pub(crate) struct Board {
    path: String,
    log: ForceLog,
    is_over: Arc<AtomicBool>,
}

impl Board {
    pub(crate) fn start() -> Self {
        let (mut port, host_end) = TTYPort::pair().expect("the system has pseudo terminals");
        port.set_timeout(Duration::from_millis(5)).expect("it is ours");
        let path = host_end.name().expect("it has a path");
        let (log, is_over) = (ForceLog::default(), Arc::new(AtomicBool::new(false)));
        let (entries, ended) = (log.clone(), Arc::clone(&is_over));
        std::thread::spawn(move || {
            let _host_end = host_end; // open as long as the board is: a host that goes does not unplug it
            let mut board = EmulatedBoard::new(LINKAGE, HELD_M);
            let mut chunk = [0; 256];
            while !ended.load(Ordering::Acquire) {
                let length = port.read(&mut chunk).unwrap_or(0);
                if length == 0 {
                    continue;
                }
                let answer = board.receive(&chunk[..length]);
                entries.push(board.force_n().map_or(0.0, DVec2::length));
                let _ = port.write_all(&answer);
            }
        });
        Self { path, log, is_over }
    }

    /// Lets every user of this machine open the port.
    pub(crate) fn admit_all_users(&self) {
        std::fs::set_permissions(&self.path, Permissions::from_mode(0o666)).expect("it is ours");
    }
}

impl Deref for Board {
    type Target = ForceLog;

    fn deref(&self) -> &ForceLog {
        &self.log
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
    }
}

/// The fixture that dies, made once; the isolation of its scene: a model from outside has a process of its own otherwise.
pub(crate) fn dies() -> &'static Path {
    static MADE: OnceLock<(Scratch, PathBuf)> = OnceLock::new();
    let (_, library) = MADE.get_or_init(|| {
        let scratch = Scratch::default();
        let library = scratch.path().join("libdies.so");
        compile_c_file(&workspace_root().join("tests/c/dies.c"), &[], &library);
        (scratch, library)
    });
    library
}

/// Where a model is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Where {
    InTheHost,
    InAProcess,
}

/// A run of a model on a board for longer than any test waits, recorded.
pub(crate) fn run_on(board: &Board, scratch: &Scratch, model: &Path, place: Where) -> Flotor {
    run_with(board, scratch, model, place, &format!("{PATIENT}\nrequire_independent_stop = true"))
}

/// A watchdog that waits longer than any test.
pub(crate) const PATIENT: &str = "watchdog_ms = 60000";

/// The same with other lines of `[limits]`.
pub(crate) fn run_with(board: &Board, scratch: &Scratch, model: &Path, place: Where, limits: &str) -> Flotor {
    let isolation = match place {
        Where::InTheHost => "isolation = \"none\"",
        Where::InAProcess => "isolation = \"process\"\nbudget_us = 1e5",
    };
    let scene = format!(
        "rate_hz = 1000\nduration_s = 120\n[device]\nplugin = \"haply\"\n[device.parameters]\nport = \"{}\"\n\
         timeout_ms = 9000\n[[model]]\nplugin = \"{}\"\nname = \"culprit\"\n{isolation}\n\
         [limits]\nforce_n = [3, 3, 0]\nramp_s = 0.05\n{limits}\n",
        board.path,
        model.display(),
    );
    let scene = scratch.file("scene.toml", scene);
    let recording = recording_in(scratch);
    let arguments: [&OsStr; 4] = ["run".as_ref(), scene.as_ref(), "--record".as_ref(), recording.as_ref()];
    Flotor::with(arguments).env("FIXTURE_MARK", &mark_in(scratch).display().to_string())
}

fn recording_in(scratch: &Scratch) -> PathBuf {
    scratch.path().join("run.mcap")
}

/// A file that is there once the fixture does what it does.
pub(crate) fn mark_in(scratch: &Scratch) -> PathBuf {
    scratch.path().join("mark")
}

/// Ticks of a recording that nobody finished, up to its last chunk.
pub(crate) fn recorded_ticks(scratch: &Scratch) -> usize {
    let recording = Recording::open(&recording_in(scratch)).expect("it can be read");
    recording.inspect(|record| assert!(record.is_ok(), "whole up to its last chunk")).count()
}

/// The processes a process has started.
pub(crate) fn children_of(parent: Pid) -> Vec<Pid> {
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
