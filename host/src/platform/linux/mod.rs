//! Linux: files of the kernel, programs that are lent a device, limits of the process.

pub(crate) mod doctor;
pub(crate) mod lend;
pub(crate) mod usb;

use rustix::process::{Resource, Signal, getrlimit, set_parent_process_death_signal};
use std::io;
use std::path::{Path, PathBuf};

/// What builds a plugin in C: `cc`.
pub(crate) const C_COMPILER: Option<&str> = None;

/// A path from the root, without links. Not real-time.
///
/// # Errors
/// What the system says.
pub(crate) fn canonical(path: &Path) -> io::Result<PathBuf> {
    path.canonicalize()
}

/// How many files this process may have open; `None`: as many as it likes.
pub(crate) fn most_open_files() -> Option<u64> {
    getrlimit(Resource::Nofile).current
}

/// From now on this process is asked to end when the one that started it ends.
pub(crate) fn end_with_parent() {
    let _ = set_parent_process_death_signal(Some(Signal::TERM));
}
