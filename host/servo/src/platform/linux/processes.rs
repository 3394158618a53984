//! Processes beside the host's own.

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus};

/// Host process, with which this process ends.
pub(crate) struct HostProcess {
    number: Option<Pid>,
}

impl HostProcess {
    /// Binds the end of this process to that of its host, which may have ended before. Not real-time.
    ///
    /// # Errors
    /// If the system call fails.
    pub(crate) fn end_with(number: i32) -> io::Result<Self> {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        Ok(Self { number: Pid::from_raw(number) })
    }

    /// Returns true if the host has ended.
    pub(crate) fn has_gone(&self) -> bool {
        getppid() != self.number
    }
}

/// Shields the process to be started from signals of the terminal.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.process_group(0);
}

/// Returns the signal that ended a process, if one did.
pub(crate) fn ending_signal(status: ExitStatus) -> Option<i32> {
    status.signal()
}
