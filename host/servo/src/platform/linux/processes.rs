//! Processes beside the host's.

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus};

/// The process that started this one, with which this one ends.
pub(crate) struct HostProcess {
    number: Option<Pid>,
}

impl HostProcess {
    /// From now on this process ends with the host of this number, which may have gone before. Not real-time.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) fn end_with(number: i32) -> io::Result<Self> {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        Ok(Self { number: Pid::from_raw(number) })
    }

    /// Whether it has gone.
    pub(crate) fn has_gone(&self) -> bool {
        getppid() != self.number
    }
}

/// What a terminal sends does not reach the process that is started so.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.process_group(0);
}

/// The signal that ended a process, if one did.
pub(crate) fn ending_signal(status: ExitStatus) -> Option<i32> {
    status.signal()
}
