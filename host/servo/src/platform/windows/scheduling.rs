//! Priorities, cores and locked memory.
#![allow(unsafe_code)] // calls of the system about the calling thread; tests/tests/system/architecture.rs lists it

use crate::platform::Duty;
use std::io;
use windows_sys::Win32::System::Threading::{
    GetCurrentThread, SetThreadAffinityMask, SetThreadPriority, THREAD_PRIORITY_HIGHEST,
    THREAD_PRIORITY_TIME_CRITICAL,
};

/// Advice for users if the system refuses a thread or a process.
pub const THREAD_ADVICE: &str = "end other programs";

/// Exclusive upper limit of the core numbers that the system can address in one processor group.
pub(crate) const MAX_CORES: usize = usize::BITS as usize;

/// System's name for the priority of the loop thread.
pub const PRIORITY_NAME: &str = "time-critical priority";
/// Returns advice for users to allow the priority of a loop.
pub(crate) fn priority_advice() -> String {
    "Windows refuses this priority only to programs in background mode".to_owned()
}

/// Message for users about locked memory: unavailable on Windows.
pub(crate) const MEMORY_ADVICE: &str = "Windows cannot lock the whole memory of a program";
/// Advice for users to find the cores that a process may use.
pub(crate) const CORE_ADVICE: &str = "the Task Manager lists them under \"Set affinity\"";

/// Returns `None`: this system cannot lock the memory of a whole process.
pub(crate) fn lock_memory() -> Option<Result<(), String>> {
    None
}

/// Does nothing: no memory is locked.
pub(crate) fn unlock_memory() {}

/// Pins the calling thread to the core with number `core`; other threads of the process are not affected. Not real-time.
///
/// # Errors
/// If there is no such core, or the process may not use it.
pub(crate) fn pin(core: usize) -> io::Result<()> {
    let mask = u32::try_from(core).ok().and_then(|core| 1_usize.checked_shl(core));
    let mask = mask.ok_or(io::ErrorKind::InvalidInput)?;
    // SAFETY: the handle that means the calling thread is always there.
    match unsafe { SetThreadAffinityMask(GetCurrentThread(), mask) } {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Requests the priority of a role for the calling thread. Not real-time.
///
/// # Errors
/// If the system refuses, with its reason.
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
