//! Windows: events of the console, its modes, handles.
#![allow(unsafe_code)] // calls of the console, and a function that it calls; tests/tests/system/architecture.rs lists it

use super::request::Request;
use crate::supervision::Side;
use flotor_core::lock;
use flotor_servo::StopSwitch;
use std::fs::File;
use std::io::{self, IsTerminal, stdin};
use std::os::windows::io::AsHandle;
use std::process::{Child, Command};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;
use windows_sys::Win32::System::Console::{
    CONSOLE_MODE, CTRL_BREAK_EVENT, CTRL_C_EVENT, ENABLE_ECHO_INPUT, ENABLE_LINE_INPUT, GetConsoleMode,
    GetStdHandle, STD_ERROR_HANDLE, STD_INPUT_HANDLE, STD_OUTPUT_HANDLE, SetConsoleCtrlHandler,
    SetConsoleMode, SetStdHandle,
};

/// Returns the limit of the first thread's stack: none, because the program file defines its size.
pub(crate) fn stack_limit_bytes() -> Option<u64> {
    None
}

/// Does nothing: Windows has no signals that a process inherits as ignored.
pub(crate) const fn accept_interrupts() {}

/// Leaves this process undivided: Windows cannot copy a process.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub(crate) fn divide() -> io::Result<Side> {
    Ok(Side::Undivided)
}

/// Returns false: no process has a supervisor.
pub(crate) fn is_orphaned() -> bool {
    false
}

/// Ends this process; Windows has no signal for that.
pub(crate) fn die_by(_: i32) -> ! {
    std::process::exit(INTERRUPTED)
}

/// Exit code after a third request, when nothing else has ended the process: that of a program ended by Ctrl-C
/// (`STATUS_CONTROL_C_EXIT`).
pub const INTERRUPTED: i32 = 0xc000_013a_u32.cast_signed();

/// Time that a closing console waits: the system ends the process 5 s after the event.
const CLOSING: Duration = Duration::from_secs(5);

/// Sender of the console's events.
static TOLD: Mutex<Option<Sender<Request>>> = Mutex::new(None);

/// Receiver of the console's events that request an end.
pub(crate) struct Requests {
    events: Receiver<Request>,
}

impl Requests {
    /// Collects the events from now on. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub(crate) fn listen(_: &StopSwitch) -> io::Result<Self> {
        let (tell, events) = channel();
        *lock(&TOLD) = Some(tell);
        handle(on_event)?;
        Ok(Self { events })
    }

    /// Waits for the next request; `None` after `patience`. Not real-time.
    pub(crate) fn next(&self, patience: Duration) -> Option<Request> {
        self.events.recv_timeout(patience).ok()
    }
}

type Handler = unsafe extern "system" fn(u32) -> i32;

fn handle(handler: Handler) -> io::Result<()> {
    // SAFETY: a function that may be called in any thread at any time, as long as the process lives.
    match unsafe { SetConsoleCtrlHandler(Some(handler), 1) } {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Handles a console event, in a thread of its own; returns 1, so that no other handler runs.
unsafe extern "system" fn on_event(event: u32) -> i32 {
    let request = if event == CTRL_BREAK_EVENT { Request::Emergency } else { Request::End };
    if let Some(tell) = &*lock(&TOLD) {
        let _ = tell.send(request);
    }
    if ![CTRL_C_EVENT, CTRL_BREAK_EVENT].contains(&event) {
        // The console closes, or the user logs off: the process ends when this returns.
        std::thread::sleep(CLOSING);
    }
    1
}

unsafe extern "system" fn on_event_of_others(_: u32) -> i32 {
    1
}

/// Ignores all events of the console that would end this process. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn outlive_requests() -> io::Result<()> {
    handle(on_event_of_others)
}

/// Console in a mode that delivers keys without a line end, until this is dropped.
pub(crate) struct KeyTerminal {
    before: CONSOLE_MODE,
}

impl KeyTerminal {
    /// Switches the console to single keys; `None` without a console: in a pipe.
    pub(crate) fn take() -> Option<Self> {
        if !stdin().is_terminal() {
            return None;
        }
        let mut before = 0;
        // SAFETY: a handle of this process, and a number that is there for the call.
        let is_known = unsafe { GetConsoleMode(GetStdHandle(STD_INPUT_HANDLE), &raw mut before) } != 0;
        let keys = before & !(ENABLE_LINE_INPUT | ENABLE_ECHO_INPUT);
        (is_known && set_mode(keys)).then_some(Self { before })
    }
}

impl Drop for KeyTerminal {
    fn drop(&mut self) {
        let _ = set_mode(self.before);
    }
}

fn set_mode(mode: CONSOLE_MODE) -> bool {
    // SAFETY: a handle of this process.
    unsafe { SetConsoleMode(GetStdHandle(STD_INPUT_HANDLE), mode) != 0 }
}

/// Returns standard output for the caller alone, and redirects all other output there to standard error. A C library that has
/// read the handle before still writes to it. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn results_apart() -> io::Result<File> {
    let own = io::stdout().as_handle().try_clone_to_owned()?;
    // SAFETY: a handle of this process, which stays open as long as it lives.
    match unsafe { SetStdHandle(STD_OUTPUT_HANDLE, GetStdHandle(STD_ERROR_HANDLE)) } {
        0 => Err(io::Error::last_os_error()),
        _ => Ok(File::from(own)),
    }
}

/// Runs a program in place of this one, which waits, and ends with its exit code; returns only on an error.
pub(crate) fn become_program(command: &mut Command) -> io::Error {
    // Events of the console are for the program.
    let ran = handle(on_event_of_others).and_then(|()| command.status());
    match ran {
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) => error,
    }
}

/// Kills a process: Windows has no request to end.
pub(crate) fn ask_to_end(child: &mut Child) {
    let _ = child.kill();
}
