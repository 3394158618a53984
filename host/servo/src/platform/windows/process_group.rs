//! Process group: on Windows only the process itself, which outlives a killed parent.

use std::io;
use std::os::windows::process::CommandExt;
use std::process::{Child, Command};

/// `CREATE_NEW_PROCESS_GROUP`: console events reach their own group only.
const NEW_PROCESS_GROUP: u32 = 0x200;

/// Gives the process to be started a process group of its own, which console events do not reach.
pub fn lead_until_parent_ends(command: &mut Command) {
    command.creation_flags(NEW_PROCESS_GROUP);
}

/// Does nothing: on Windows the process outlives its parent.
pub fn end_with_this_thread(_: &mut Command) {}

/// Returns true once a child has ended.
///
/// # Errors
/// If the system call fails.
pub fn has_ended(child: &mut Child) -> io::Result<bool> {
    Ok(child.try_wait()?.is_some())
}

/// Kills a child.
pub fn kill(child: &mut Child) {
    let _ = child.kill();
}
