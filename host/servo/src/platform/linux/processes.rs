//! Worker processes: lifetime, process group and exit status.

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus};

/// Host process of this worker.
pub(crate) struct HostProcess {
    number: Option<Pid>,
}

impl HostProcess {
    /// Makes the system kill this process when its parent, the host, ends; the host may already have ended. Not real-time.
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

/// Gives the process to be started a process group of its own, which terminal signals do not reach.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.process_group(0);
}

/// Returns the signal that ended a process; `None` if it exited.
pub(crate) fn ending_signal(status: ExitStatus) -> Option<i32> {
    status.signal()
}
