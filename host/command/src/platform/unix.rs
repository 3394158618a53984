//! Unix: signals, single-key terminal mode, redirection of standard output, and child processes.

mod supervision;

use super::request::Request;
use flotor_servo::StopSwitch;
use flotor_servo::platform::{block_sent_signals, block_signals, wait_for_signal};
use rustix::process::{Pid, Resource, Signal, getpgrp, getrlimit, kill_process};
use rustix::termios::{LocalModes, OptionalActions, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr};
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2,
    SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::flag;
use std::fs::File;
use std::io::{self, stdin};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

pub(crate) use supervision::{accept_interrupts, die_by, divide, is_orphaned};

/// Exit code of a forced end, for example after a third signal: 128 + SIGINT, as in shells.
pub const INTERRUPTED: i32 = 130;

/// Signals that stop a run: sent by the keys of a terminal (Ctrl-C, `Ctrl-\`, Ctrl-Z), by a closing terminal, and by process managers.
///
/// By default they would end the process without stopping the device, or, at Ctrl-Z, suspend the loop and its watchdog together,
/// with the last force still applied.
const ENDING: [i32; 5] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP];

/// Signals that suspend a background process, loop and watchdog together, when it writes to its terminal or reads from it. They are
/// blocked and never received, so that the progress line is written, and a read fails.
const SUSPENDING: [i32; 2] = [SIGTTIN, SIGTTOU];

/// Receiver of the signals that request an end.
pub(crate) struct Requests {
    signals: Vec<i32>,
}

impl Requests {
    /// Blocks the signals in this thread and in all threads that it starts, so that [`Self::next`] receives them. In a thread that
    /// has unblocked the signals, a signal sets a flag of `stop` instead. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub(crate) fn listen(stop: &StopSwitch) -> io::Result<Self> {
        // A run that was started with `nohup` has to continue after its terminal closes.
        let ending = ENDING.into_iter().filter(|signal| *signal != SIGHUP || !is_ignored(SIGHUP));
        let signals: Vec<i32> = ending.chain([SIGUSR1]).collect();
        block_signals(&[&signals[..], &SUSPENDING].concat())?;
        // This thread may not get a processor while a plugin in the loop occupies it.
        block_sent_signals()?;
        // A thread in which a library has unblocked the signals sets these flags when it receives one.
        for signal in &signals {
            let flag = if *signal == SIGUSR1 { stop.emergency_flag() } else { stop.stop_flag() };
            flag::register(*signal, flag)?;
        }
        // Otherwise a file at its size limit would end the process, not the recording.
        flag::register(SIGXFSZ, Arc::<AtomicBool>::default())?;
        Ok(Self { signals })
    }

    /// Waits for the next request; `None` after the timeout `patience`. Not real-time.
    pub(crate) fn next(&self, patience: Duration) -> Option<Request> {
        let signal = wait_for_signal(&self.signals, patience)?;
        Some(if signal == SIGUSR1 { Request::Emergency } else { Request::End })
    }
}

/// Blocks all signals that request the end of this process, in this thread and in all threads that it starts. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn outlive_requests() -> io::Result<()> {
    let signals = [SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU, SIGXFSZ];
    block_signals(&[&ENDING[..], &SUSPENDING, &signals].concat())
}

/// Returns the limit on the stack size of the main thread (`RLIMIT_STACK`), bytes; `None` if unlimited.
pub(crate) fn stack_limit_bytes() -> Option<u64> {
    getrlimit(Resource::Stack).current
}

/// Returns true if this process ignores a signal.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    (ignored >> (signal - 1)) & 1 == 1 // the lowest bit is signal 1
}

/// Terminal in a mode that delivers single keys without waiting for a line end; dropping it restores the previous mode.
pub(crate) struct KeyTerminal {
    before: Termios,
}

impl KeyTerminal {
    /// Switches the terminal of standard input to single keys; `None` without a terminal (a pipe), or in the background.
    pub(crate) fn take() -> Option<Self> {
        let terminal = stdin();
        // In the background another program controls the terminal.
        if !isatty(&terminal) || !is_in_foreground() {
            return None;
        }
        let before = tcgetattr(&terminal).ok()?;
        let mut keys = before.clone();
        keys.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        tcsetattr(&terminal, OptionalActions::Now, &keys).ok()?;
        Some(Self { before })
    }
}

impl Drop for KeyTerminal {
    fn drop(&mut self) {
        // In the background another program controls the terminal.
        if is_in_foreground() {
            let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
        }
    }
}

/// Returns true if the terminal's keys go to this process.
fn is_in_foreground() -> bool {
    tcgetpgrp(stdin()).is_ok_and(|group| group == getpgrp())
}

/// Returns a private duplicate of standard output, and redirects the standard output of the process (plugins included) to standard
/// error. Not real-time.
///
/// # Errors
/// Errors of the system.
pub(crate) fn results_apart() -> io::Result<File> {
    let own = rustix::io::fcntl_dupfd_cloexec(io::stdout(), 3)?;
    rustix::stdio::dup2_stdout(io::stderr())?;
    Ok(File::from(own))
}

/// Replaces this process by a program; returns only on an error.
pub(crate) fn become_program(command: &mut Command) -> io::Error {
    command.exec()
}

/// Sends SIGTERM to a child process, the request to end in order.
pub(crate) fn ask_to_end(child: &mut Child) {
    let process = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let _ = process.map(|process| kill_process(process, Signal::TERM));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_known() {
        assert!(!is_ignored(signal_hook::consts::SIGKILL), "no process can ignore it");
        assert!(is_ignored(signal_hook::consts::SIGPIPE), "Rust starts every program so");
    }
}
