//! Processes beside the host's own.

use super::no_workers;
use std::io;
use std::os::windows::process::CommandExt;
use std::process::{Command, ExitStatus};

/// `CREATE_NEW_PROCESS_GROUP`: console events reach their own group only.
const NEW_PROCESS_GROUP: u32 = 0x200;

/// Host process, with which this process ends: not available yet.
pub(crate) enum HostProcess {}

impl HostProcess {
    /// Binds the end of this process to that of its host: not available yet.
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

/// Shields the process to be started from console events.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.creation_flags(NEW_PROCESS_GROUP);
}

/// Returns `None`: no signal ends a process.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}
