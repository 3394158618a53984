//! Worker processes: not available yet.

use super::no_workers;
use std::io;
use std::os::windows::process::CommandExt;
use std::process::{Command, ExitStatus};

/// `CREATE_NEW_PROCESS_GROUP`: console events reach their own group only.
const NEW_PROCESS_GROUP: u32 = 0x200;

/// Host process of this worker: not available yet.
pub(crate) enum HostProcess {}

impl HostProcess {
    /// Returns an error: binding the end of this process to the host is not available yet.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn end_with(_: i32) -> io::Result<Self> {
        Err(no_workers())
    }

    /// Returns true if the host has ended.
    pub(crate) fn has_gone(&self) -> bool {
        match *self {}
    }
}

/// Gives the process to be started a process group of its own, which console events do not reach.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.creation_flags(NEW_PROCESS_GROUP);
}

/// Returns `None`: no signal ends a process.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}
