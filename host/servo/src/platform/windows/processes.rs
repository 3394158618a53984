//! Processes beside the host's.

use super::not_yet;
use std::io;
use std::os::windows::process::CommandExt;
use std::process::{Command, ExitStatus};

/// `CREATE_NEW_PROCESS_GROUP`: what a console sends goes to its own group.
const NEW_PROCESS_GROUP: u32 = 0x200;

/// The process that started this one, with which this one ends. There is none yet.
pub(crate) enum HostProcess {}

impl HostProcess {
    /// From now on this process ends with the host of this number.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn end_with(_: i32) -> io::Result<Self> {
        Err(not_yet("a model in a process of its own"))
    }

    /// Whether it has gone.
    pub(crate) fn has_gone(&self) -> bool {
        match *self {}
    }
}

/// What a console sends does not reach the process that is started so.
pub(crate) fn keep_from_terminal(command: &mut Command) {
    command.creation_flags(NEW_PROCESS_GROUP);
}

/// The signal that ended a process: none ever does.
pub(crate) fn ending_signal(_: ExitStatus) -> Option<i32> {
    None
}
