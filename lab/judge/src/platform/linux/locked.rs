//! Check that a step only computes.
//!
//! The kernel can sandbox a thread (seccomp, strict mode): any system call other than read and write ends that thread.
//! A sandboxed thread steps a model along a path; if it completes, the model has opened no file, started no thread, and
//! waited for no other thread.
//!
//! An allocation is a system call too if the C library serves each one from the system, as [`C_LIBRARY`] sets;
//! otherwise a pair of `malloc` and `free` would leave no trace. Strict mode permits reads and writes; they are found
//! by the counters of the kernel.

use crate::validate::Outcome;
use crate::validate::path::walk;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, Output};
use flotor_loader::Model;
use rustix::process::{Signal, getpid, kill_process};
use rustix::thread::{SecureComputingMode, gettid, set_secure_computing_mode};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Environment variable of the GNU C library that makes each allocation a system call: mappings from the first byte on,
/// in one arena, and no more of them than the kernel allows a process.
const C_LIBRARY: (&str, &str) =
    ("GLIBC_TUNABLES", "glibc.malloc.mmap_threshold=0:glibc.malloc.mmap_max=30000:glibc.malloc.arena_max=1");

/// Signal that ends the process after a system call in a step.
const CAUGHT: Signal = Signal::SYS;

/// Number of steps; the first is sandboxed too, because a loop treats all steps alike.
const STEPS: usize = 1000;

/// Poll interval of the thread's progress.
const LOOK: Duration = Duration::from_millis(2);

const WAITING: u8 = 0;
const LOCKED: u8 = 1;
const NOT_ALLOWED: u8 = 2;
const DONE: u8 = 3;
const FAILED: u8 = 4;

/// Prepares the process of the check: sets the allocator's environment variable.
pub(crate) fn prepare(command: &mut Command) {
    let (variable, value) = C_LIBRARY;
    command.env(variable, value);
}

/// Returns true if a process was ended because a step made a system call, by its signal.
pub(crate) fn has_caught(signal: i32) -> bool {
    signal == CAUGHT.as_raw()
}

/// Steps the model in a sandboxed thread. **Ends this process** by [`CAUGHT`] if a step made a system call other than read or
/// write.
///
/// # Errors
/// [`Outcome::Violation`] if a step fails, reads or writes; [`Outcome::Missing`] without a thread, `/proc` or seccomp.
pub(crate) fn system_calls(model: Model) -> Result<(), Outcome> {
    let stage = Arc::new(AtomicU8::new(WAITING));
    let (ready, told) = channel();
    let of_thread = Arc::clone(&stage);
    let walking = std::thread::Builder::new().spawn(move || walk_locked_in(model, &ready, &of_thread));
    walking.map_err(|cause| Outcome::no_thread(&cause))?;
    let ended = |_| Outcome::Violation("the thread of the check ended before its first step".to_owned());
    let thread = told.recv().map_err(ended)?;
    let folder = PathBuf::from(format!("/proc/self/task/{thread}"));
    if !folder.exists() {
        return Err(Outcome::Missing("the test needs /proc; mount /proc".to_owned()));
    }
    let before = transfers(&folder);
    stage.store(LOCKED, Ordering::Release);
    loop {
        // Read the folder first, then the stage: the thread stores its stage before it ends.
        let is_there = folder.exists();
        match stage.load(Ordering::Acquire) {
            DONE => break,
            FAILED => {
                return Err(Outcome::Violation(
                    "a step of the path failed while system calls were forbidden".to_owned(),
                ));
            }
            NOT_ALLOWED => {
                return Err(Outcome::Missing(
                    "the system does not allow seccomp in strict mode; run the check outside a container or \
                     sandbox"
                        .to_owned(),
                ));
            }
            _ if !is_there => end_here(),
            _ => std::thread::sleep(LOOK),
        }
    }
    match (before, transfers(&folder)) {
        (Some(before), Some(after)) if after > before => Err(Outcome::Violation(format!(
            "the number of read or write system calls in {STEPS} steps of the model is {}; move file access and printing out of `step`",
            after - before
        ))),
        _ => Ok(()),
    }
}

/// Runs the thread of the check; once sandboxed it never ends.
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
    // Ending the thread is a system call too: spin until the process ends.
    loop {
        std::hint::spin_loop();
    }
}

/// Ends this process by [`CAUGHT`]. The dead thread may hold the lock of the allocator, so this thread must not
/// allocate and cannot write a message; the signal reports the violation.
fn end_here() -> ! {
    let _ = kill_process(getpid(), CAUGHT);
    std::process::abort()
}

/// Returns the number of reads and writes of a thread; `None` where the kernel does not count.
fn transfers(folder: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(folder.join("io")).ok()?;
    let count =
        |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<u64>().ok());
    Some(count("syscr:")? + count("syscw:")?)
}
