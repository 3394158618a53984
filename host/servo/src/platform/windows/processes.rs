//! Worker processes: not available yet.

use super::no_workers;
use std::io;
use std::process::ExitStatus;

/// Host process of this worker: not available yet.
pub(crate) enum HostProcess {}

impl HostProcess {
    /// Returns an error: worker processes are not available yet.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn new(_: i32) -> io::Result<Self> {
        Err(no_workers())
    }

    /// Returns true if the host has ended.
    pub(crate) fn has_gone(&self) -> bool {
        match *self {}
    }
}

/// Returns `None`: no signal ends a process.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}
