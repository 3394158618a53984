//! Linux: diagnosis from files of the kernel, limits of the process.

pub(crate) mod doctor;
pub(crate) mod usb;

use flotor_command::CommandError;
use rustix::process::{Resource, Signal, getrlimit, set_parent_process_death_signal};
use std::io;
use std::path::{Path, PathBuf};

/// Command that builds a plugin in C, if other than `cc`.
pub(crate) const C_COMPILER: Option<&str> = None;

/// Returns an absolute path without links. Not real-time.
///
/// # Errors
/// Error of the system if the path does not exist or cannot be read.
pub(crate) fn canonical(path: &Path) -> io::Result<PathBuf> {
    path.canonicalize()
}

/// Returns the limit on the number of open files of this process; `None` if unlimited.
pub(crate) fn most_open_files() -> Option<u64> {
    getrlimit(Resource::Nofile).current
}

/// Checks that `flotor lend` is supported on this system.
///
/// # Errors
/// None on Linux.
pub(crate) fn check_lend() -> Result<(), CommandError> {
    Ok(())
}

/// Requests that the system sends SIGTERM to this process when its parent ends.
pub(crate) fn end_with_parent() {
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
}
