//! Priorities, cores and locked memory.
#![allow(unsafe_code)] // calls of the system about the calling thread; tests/tests/system/architecture.rs lists it

use std::io;
use windows_sys::Win32::System::Threading::{
    GetCurrentThread, SetThreadAffinityMask, SetThreadPriority, THREAD_PRIORITY_HIGHEST,
    THREAD_PRIORITY_TIME_CRITICAL,
};

/// How a user gets room for a thread or a process that the system has refused.
pub const THREAD_ADVICE: &str = "end other programs";

/// Cores that the system can name in one group of processors.
pub(crate) const MOST_CORES: usize = usize::BITS as usize;

/// How this system calls the priority that a loop asks for.
pub const PRIORITY_NAME: &str = "time-critical priority";
/// Returns how a user allows it.
pub(crate) fn priority_advice() -> String {
    "Windows refuses it to programs in the background mode of their priority only".to_owned()
}

/// How a user allows locked memory.
pub(crate) const MEMORY_ADVICE: &str = "Windows locks the memory of no whole program";
/// How a user finds the cores that a process may use.
pub(crate) const CORE_ADVICE: &str = "the Task Manager lists them under \"Set affinity\"";

/// What a thread of the host is for, which its priority follows from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Duty {
    /// Runs the loop.
    Loop,
    /// Runs a model in a process of its own: below the loop, which waits for it but not for ever.
    Worker,
    /// Interrupts the loop. The system has nothing above it: beside it.
    Watchdog,
}

/// Locks the memory of the process: this system does not.
pub(crate) fn lock_memory() -> Option<Result<(), String>> {
    None
}

/// Takes it back.
pub(crate) fn unlock_memory() {}

/// Keeps the calling thread on the core of this number; the process's other threads go where they did. Not real-time.
///
/// # Errors
/// There is no such core, or it is not this process's.
pub(crate) fn pin(core: usize) -> Result<(), NoSuchCore> {
    let mask = u32::try_from(core).ok().and_then(|core| 1_usize.checked_shl(core)).ok_or(NoSuchCore)?;
    // SAFETY: the handle that means the calling thread is always there.
    match unsafe { SetThreadAffinityMask(GetCurrentThread(), mask) } {
        0 => Err(NoSuchCore),
        _ => Ok(()),
    }
}

/// The machine has no such core, or the process may not use it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoSuchCore;

/// Asks for the priority of a duty for the calling thread. Not real-time.
///
/// # Errors
/// What the system says.
pub(crate) fn enter_priority(duty: Duty) -> Result<(), String> {
    let priority = match duty {
        Duty::Worker => THREAD_PRIORITY_HIGHEST,
        Duty::Loop | Duty::Watchdog => THREAD_PRIORITY_TIME_CRITICAL,
    };
    // SAFETY: the handle that means the calling thread is always there.
    match unsafe { SetThreadPriority(GetCurrentThread(), priority) } {
        0 => Err(io::Error::last_os_error().to_string()),
        _ => Ok(()),
    }
}
