//! Last stop on Windows: handlers of unhandled exceptions and of `exit`.
//!
//! Nothing that runs in a handler allocates, locks or formats into memory of its own. There are no signals: the command line
//! handles console events, which no plugin can replace.
//!
//! Not caught: `abort` and other immediate terminations (`__fastfail`), heap corruption that the system finds, which bypass all
//! filters; and `TerminateProcess`. Then only the watchdog of a device itself can stop the device. The end of the process by `exit`
//! is reported by a callback of the loader. Wine 8 does not call this callback for a program, so it is not tested.
#![allow(unsafe_code)] // neither filter nor callback can be made without; tests/tests/system/architecture.rs lists it

use crate::guest::program_handles_signals;
use crate::last_stop::{Death, end_if_armed, end_if_in_call, is_armed, is_in_call};
use std::ffi::c_void;
use std::io;
use std::process::{Child, Command};
use windows_sys::Win32::Foundation::{
    EXCEPTION_ACCESS_VIOLATION, EXCEPTION_BREAKPOINT, EXCEPTION_FLT_DIVIDE_BY_ZERO,
    EXCEPTION_ILLEGAL_INSTRUCTION, EXCEPTION_IN_PAGE_ERROR, EXCEPTION_INT_DIVIDE_BY_ZERO,
    EXCEPTION_PRIV_INSTRUCTION, EXCEPTION_STACK_OVERFLOW,
};
use windows_sys::Win32::Storage::FileSystem::WriteFile;
use windows_sys::Win32::System::Console::{GetStdHandle, STD_ERROR_HANDLE};
use windows_sys::Win32::System::Diagnostics::Debug::{EXCEPTION_POINTERS, SetUnhandledExceptionFilter};
use windows_sys::Win32::System::SystemServices::DLL_PROCESS_DETACH;
use windows_sys::Win32::System::Threading::{
    GetCurrentProcess, GetCurrentThreadId, SetThreadStackGuarantee, TerminateProcess,
};

/// Capacity of a thread's name with its terminator, bytes.
pub(crate) const NAME_BYTES: usize = 16;
/// Stack reserved for the filter after a stack overflow, bytes: a device's stop takes little.
const STACK_BYTES: u32 = 64 * 1024;
/// Result of an exception filter: the next filter is called, which ends the process.
const CONTINUE_SEARCH: i32 = 0;

/// Installs handlers for unhandled exceptions and for `exit`, not for the ends listed in the head of this module. Repeated for each
/// run, because a plugin may have installed other handlers. Not real-time.
pub(crate) fn install() {
    let mut bytes = STACK_BYTES;
    // SAFETY: a number that is there for the call.
    let _ = unsafe { SetThreadStackGuarantee(&raw mut bytes) };
    if !program_handles_signals() {
        // SAFETY: a function that may be called in any thread at any time.
        let _ = unsafe { SetUnhandledExceptionFilter(Some(on_exception)) };
    }
    // A volatile read keeps the callback in the program.
    // SAFETY: a static of this module.
    let _ = unsafe { std::ptr::read_volatile(&raw const AT_END) };
}

/// Installs the handlers of [`install`]: an exception belongs to the thread that raises it.
pub(crate) fn install_for_crashes() {
    install();
}

/// Does nothing: no signals are sent to the process.
pub(crate) fn take_sent() {}

unsafe extern "system" fn on_exception(exception: *const EXCEPTION_POINTERS) -> i32 {
    // SAFETY: the system passes a description that is there for the call.
    let code = unsafe { (*(*exception).ExceptionRecord).ExceptionCode };
    let death = Death::Signal { signal: code, sender: None };
    end_if_armed(death);
    end_if_in_call(death);
    CONTINUE_SEARCH
}

/// Callback of the loader at the end of the process, when all other threads have ended.
#[used]
#[unsafe(link_section = ".CRT$XLD")]
static AT_END: unsafe extern "system" fn(*mut c_void, u32, *mut c_void) = at_end;

unsafe extern "system" fn at_end(_: *mut c_void, reason: u32, _: *mut c_void) {
    if reason == DLL_PROCESS_DETACH && (is_armed() || is_in_call()) {
        end_if_armed(Death::Exit);
        end_if_in_call(Death::Exit);
    }
}

/// Ends the process with a code.
pub(crate) fn end_by(_: Death, code: i32) -> ! {
    exit_process(code)
}

/// Ends the process at once, without exit handlers. Real-time: never returns.
pub(crate) fn exit_process(code: i32) -> ! {
    // SAFETY: the handle that means this process is always there.
    let _ = unsafe { TerminateProcess(GetCurrentProcess(), code.cast_unsigned()) };
    // Not reached, if the system lets a process end itself.
    std::process::abort()
}

/// Writes to standard error, once and without error handling: the reader may be closed.
pub(crate) fn say(bytes: &[u8]) {
    let (mut written, length) = (0, u32::try_from(bytes.len()).unwrap_or(0));
    // SAFETY: the bytes are there for the call, and as many as said; a null pointer where no waiting is described.
    let _ = unsafe {
        WriteFile(
            GetStdHandle(STD_ERROR_HANDLE),
            bytes.as_ptr(),
            length,
            &raw mut written,
            std::ptr::null_mut(),
        )
    };
}

/// Returns the id of the calling thread.
pub(crate) fn thread_number() -> i32 {
    // SAFETY: takes nothing, and cannot fail.
    unsafe { GetCurrentThreadId() }.cast_signed()
}

/// Returns the id of the calling thread as its name: the system returns names only in memory that it allocates.
pub(crate) fn thread_name(name: &mut [u8; NAME_BYTES]) -> &str {
    let mut rest = &mut name[..];
    let _ = io::Write::write_fmt(&mut rest, format_args!("{}", thread_number().cast_unsigned()));
    let left = rest.len();
    std::str::from_utf8(name.get(..NAME_BYTES - left).unwrap_or_default()).unwrap_or_default()
}

/// Name of an exception that ends a process, with its cause.
pub struct SignalName(pub i32);

impl SignalName {
    /// Returns true: the process itself raises each exception.
    #[must_use]
    pub fn is_a_crash(&self) -> bool {
        true
    }
}

impl std::fmt::Display for SignalName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(code) = *self;
        let words = match code {
            EXCEPTION_ACCESS_VIOLATION => "invalid memory access",
            EXCEPTION_IN_PAGE_ERROR => "a page of memory could not be read from disk or network",
            EXCEPTION_STACK_OVERFLOW => "stack overflow",
            EXCEPTION_INT_DIVIDE_BY_ZERO | EXCEPTION_FLT_DIVIDE_BY_ZERO => "arithmetic error",
            EXCEPTION_ILLEGAL_INSTRUCTION | EXCEPTION_PRIV_INSTRUCTION => "illegal instruction",
            EXCEPTION_BREAKPOINT => "breakpoint",
            _ => "an unhandled exception",
        };
        f.write_str("exception ")?;
        write!(f, "{:#010x} ({words})", code.cast_unsigned())
    }
}

// ---------------------------------------------------------------- signals, of which there are none

/// Does nothing: the process ignores no signals.
pub fn ignore_no_signal() {}

/// Starts a process. Not real-time.
///
/// # Errors
/// If the system cannot start the process.
pub fn spawn_unblocked(command: &mut Command) -> io::Result<Child> {
    command.spawn()
}

/// Snapshot of the host's signal actions: empty on this system.
pub struct SignalGuard;

/// Signals of the host whose action a plugin has replaced: none on this system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TakenSignals(());

impl SignalGuard {
    /// Returns the empty snapshot.
    #[must_use]
    pub fn take() -> Self {
        Self
    }

    /// Restores nothing, and returns the empty set.
    pub fn put_back(&self) -> TakenSignals {
        TakenSignals(())
    }
}

impl TakenSignals {
    /// Returns true: the set is always empty.
    #[must_use]
    pub const fn is_none(self) -> bool {
        true
    }

    /// Encodes the signals for an atomic word.
    #[must_use]
    pub(crate) const fn bits(self) -> u64 {
        0
    }

    /// Decodes the word of [`Self::bits`].
    pub(crate) const fn from_bits(_: u64) -> Self {
        Self(())
    }
}

/// Writes no names.
impl std::fmt::Display for TakenSignals {
    fn fmt(&self, _: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::last_stop::enter_call;

    /// Set in the process that crashes.
    const VARIABLE: &str = "FLOTOR_TEST_CRASHES";

    #[test]
    fn a_plugin_that_crashes_in_a_call_is_named_and_ends_the_process_with_code_3() {
        if std::env::var_os(VARIABLE).is_some() {
            enter_call("jelly", "`create`");
            // SAFETY: it is not sound, and is to crash.
            unsafe { std::ptr::without_provenance_mut::<u8>(8).write_volatile(1) };
        }
        let own = std::env::current_exe().expect("a test has a file");
        let name = "a_plugin_that_crashes_in_a_call_is_named_and_ends_the_process_with_code_3";
        let crashed = Command::new(own).args([name, "--nocapture"]).env(VARIABLE, "1").output();
        let crashed = crashed.expect("it starts");
        let told = String::from_utf8_lossy(&crashed.stderr);
        assert_eq!(crashed.status.code(), Some(3), "{told}");
        let line =
            "error: `jelly` ended the process in `create`: exception 0xc0000005 (invalid memory access)";
        assert!(told.contains(line), "{told}");
    }
}
