//! Whether a step computes and does nothing else.
//!
//! The kernel can lock a thread in (seccomp, strict mode): whatever it asks of the system but to read and to
//! write ends that thread. A thread that has been locked in walks a model along a path; one that comes
//! through has opened no file, started no thread, and waited for no other thread.
//!
//! An allocation is such a call as well, if the C library is told to serve each from the system, which
//! [`C_LIBRARY`] does: of a pair of `malloc` and `free` nothing else is left to see. Reading and writing are
//! counted by the kernel.

use crate::validate::Seen;
use crate::validate::path::walk;
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::Model;
use flotor_hal::{Input, Output};
use rustix::process::{Signal, getpid, kill_process};
use rustix::thread::{SecureComputingMode, gettid, set_secure_computing_mode};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Environment variable of the GNU C library, and what makes each allocation a system call: mappings from the
/// first byte on, in one arena; no more of them than the kernel allows a process.
const C_LIBRARY: (&str, &str) =
    ("GLIBC_TUNABLES", "glibc.malloc.mmap_threshold=0:glibc.malloc.mmap_max=30000:glibc.malloc.arena_max=1");

/// How the process ends in which a step called the system.
const CAUGHT: Signal = Signal::SYS;

/// Steps; the first is locked in, too: a loop has no other.
const STEPS: usize = 1000;

/// How often the thread is looked at.
const LOOK: Duration = Duration::from_millis(2);

const WAITING: u8 = 0;
const LOCKED: u8 = 1;
const NOT_ALLOWED: u8 = 2;
const DONE: u8 = 3;
const FAILED: u8 = 4;

/// Prepares the process of the check.
pub(crate) fn prepare(command: &mut Command) {
    let (variable, value) = C_LIBRARY;
    command.env(variable, value);
}

/// Whether a process ended because a step called the system, by the signal that ended it.
pub(crate) fn has_caught(signal: i32) -> bool {
    signal == CAUGHT.as_raw()
}

/// Walks the model in a thread that is locked in. **Ends this process** by [`CAUGHT`] if a step called the
/// system.
pub(crate) fn system_calls(model: Model) -> Result<(), Seen> {
    let stage = Arc::new(AtomicU8::new(WAITING));
    let (ready, told) = channel();
    let of_thread = Arc::clone(&stage);
    let walking = std::thread::Builder::new().spawn(move || walk_locked_in(model, &ready, &of_thread));
    walking.map_err(|cause| Seen::no_thread(&cause))?;
    let ended = |_| Seen::Violation("its thread ended before the test".to_owned());
    let thread = told.recv().map_err(ended)?;
    let folder = PathBuf::from(format!("/proc/self/task/{thread}"));
    if !folder.exists() {
        return Err(Seen::Missing("the system has no /proc, which the test needs".to_owned()));
    }
    let before = transfers(&folder);
    stage.store(LOCKED, Ordering::Release);
    loop {
        // First whether it is there, then what it said last.
        let is_there = folder.exists();
        match stage.load(Ordering::Acquire) {
            DONE => break,
            FAILED => return Err(Seen::Violation("a step of the path failed".to_owned())),
            NOT_ALLOWED => {
                return Err(Seen::Missing("the system does not allow seccomp (strict mode)".to_owned()));
            }
            _ if !is_there => end_here(),
            _ => std::thread::sleep(LOOK),
        }
    }
    match (before, transfers(&folder)) {
        (Some(before), Some(after)) if after > before => {
            Err(Seen::Violation(format!("it read or wrote {} times in {STEPS} steps", after - before)))
        }
        _ => Ok(()),
    }
}

/// What the thread does: never ends once it is locked in.
fn walk_locked_in(mut model: Model, ready: &Sender<i32>, stage: &AtomicU8) {
    let inputs: Vec<Input> = walk(STEPS as u64).collect();
    let _ = ready.send(gettid().as_raw_nonzero().get());
    while stage.load(Ordering::Acquire) == WAITING {
        std::hint::spin_loop();
    }
    let mut output = Output::default();
    if set_secure_computing_mode(SecureComputingMode::Strict).is_err() {
        stage.store(NOT_ALLOWED, Ordering::Release);
        return;
    }
    let mut is_answered = true;
    for input in &inputs {
        is_answered &= model.step(input, &mut output) == CallStatus::Ok;
    }
    stage.store(if is_answered { DONE } else { FAILED }, Ordering::Release);
    // To go home is a system call, too: it ends with the process.
    loop {
        std::hint::spin_loop();
    }
}

/// The thread is gone, and may have held the lock of the allocator: nothing may be allocated any more, so
/// nothing can be said either. The signal says it.
fn end_here() -> ! {
    let _ = kill_process(getpid(), CAUGHT);
    std::process::abort()
}

/// How often a thread has read and written; `None` where the kernel does not count.
fn transfers(folder: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(folder.join("io")).ok()?;
    let count =
        |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<u64>().ok());
    Some(count("syscr:")? + count("syscw:")?)
}
