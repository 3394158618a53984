//! Worker processes: their host, and their exit status.

use rustix::process::{Pid, getppid};
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

/// Host process of this worker.
pub(crate) struct HostProcess {
    number: Option<Pid>,
}

impl HostProcess {
    /// Creates the handle of the host process with the id `number`; the process may already have ended. Not real-time.
    ///
    /// # Errors
    /// None on Linux.
    #[allow(clippy::unnecessary_wraps)] // as on other systems
    pub(crate) fn new(number: i32) -> io::Result<Self> {
        Ok(Self { number: Pid::from_raw(number) })
    }

    /// Returns true if the host has ended.
    pub(crate) fn has_gone(&self) -> bool {
        getppid() != self.number
    }
}

/// Returns the signal that ended a process; `None` if the process exited.
pub(crate) fn ending_signal(status: ExitStatus) -> Option<i32> {
    status.signal()
}
