//! Windows: console events, single-key console mode, redirection of standard output, and child processes.
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

/// Returns `None`: the executable defines the stack size of the main thread.
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

/// Ends this process with [`INTERRUPTED`]: Windows has no signals.
pub(crate) fn die_by(_: i32) -> ! {
    std::process::exit(INTERRUPTED)
}

/// Exit code of a forced end, for example after a third request: the code of a program ended by Ctrl-C (`STATUS_CONTROL_C_EXIT`).
pub const INTERRUPTED: i32 = 0xc000_013a_u32.cast_signed();

/// Wait in the handler of a closing console: the system ends the process 5 s after the event.
const CLOSING: Duration = Duration::from_secs(5);

/// Sender of console events to [`Requests`].
static TOLD: Mutex<Option<Sender<Request>>> = Mutex::new(None);

/// Receiver of the console's events that request an end.
pub(crate) struct Requests {
    events: Receiver<Request>,
}

impl Requests {
    /// Installs a handler that collects the console events. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub(crate) fn listen(_: &StopSwitch) -> io::Result<Self> {
        let (tell, events) = channel();
        *lock(&TOLD) = Some(tell);
        handle(on_event)?;
        Ok(Self { events })
    }

    /// Waits for the next request; `None` after the timeout `patience`. Not real-time.
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

/// Handles a console event, in a thread that the system starts; returns 1, so that no other handler runs.
unsafe extern "system" fn on_event(event: u32) -> i32 {
    let request = if event == CTRL_BREAK_EVENT { Request::Emergency } else { Request::End };
    if let Some(tell) = &*lock(&TOLD) {
        let _ = tell.send(request);
    }
    if ![CTRL_C_EVENT, CTRL_BREAK_EVENT].contains(&event) {
        // The console closes, or the user logs off: the process ends when this handler returns.
        std::thread::sleep(CLOSING);
    }
    1
}

unsafe extern "system" fn on_event_of_others(_: u32) -> i32 {
    1
}

/// Ignores all console events that would end this process. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn outlive_requests() -> io::Result<()> {
    handle(on_event_of_others)
}

/// Console in a mode that delivers single keys without waiting for a line end; dropping it restores the previous mode.
pub(crate) struct KeyTerminal {
    before: CONSOLE_MODE,
}

impl KeyTerminal {
    /// Switches the console of standard input to single keys; `None` without a console (a pipe).
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

/// Returns a private duplicate of standard output, and redirects the standard output of the process (plugins included) to standard
/// error. A C library that has read the handle before still writes to standard output. Not real-time.
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

/// Runs a program, waits for its end, and ends this process with its exit code; returns only on an error.
pub(crate) fn become_program(command: &mut Command) -> io::Error {
    // The program handles console events.
    let ran = handle(on_event_of_others).and_then(|()| command.status());
    match ran {
        Ok(status) => std::process::exit(status.code().unwrap_or(1)),
        Err(error) => error,
    }
}

/// Kills a child process: Windows has no signal that requests its end.
pub(crate) fn ask_to_end(child: &mut Child) {
    let _ = child.kill();
}
