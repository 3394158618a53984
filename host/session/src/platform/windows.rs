//! Windows: working directory and file times. Permissions of folders are not checked yet.

use std::fs::Metadata;
use std::os::windows::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Warning, for users, about ends of this process that stop no device.
pub(crate) const NOT_CAUGHT: Option<&str> = Some(
    "on Windows nothing stops a device if a plugin ends this program by `abort` or corrupts its heap, or if another \
     program (Task Manager) ends this program; keep a hand at the power switch",
);

/// State of the process that plugins share with the host: the working directory. Limits of a process are set from outside, and a
/// plugin's thread knows no id with which it could change the priority of another thread.
pub(crate) struct MachineState {
    folder: Option<PathBuf>,
}

impl MachineState {
    /// Reads the current state. Not real-time.
    pub(crate) fn now() -> Self {
        Self { folder: std::env::current_dir().ok() }
    }

    /// Restores the changed parts and returns the names of all changed parts, also of those that the system refuses to restore. Not
    /// real-time.
    pub(crate) fn restore(&self) -> Vec<&'static str> {
        match &self.folder {
            Some(folder) if Self::now().folder.as_ref() != Some(folder) => {
                let _ = std::env::set_current_dir(folder);
                vec!["the working folder"]
            }
            _ => Vec::new(),
        }
    }
}

/// Returns creation time and attributes, which distinguish a file from another file of the same name.
pub(crate) fn identity(file: &Metadata) -> [u64; 2] {
    [file.creation_time(), u64::from(file.file_attributes())]
}

/// Returns the time of the last write, s and ns since 1970. A program can set this time back, so length and creation time of the
/// file have to match as well.
pub(crate) fn changed(file: &Metadata) -> (i64, i64) {
    let since = file.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    (i64::try_from(since.as_secs()).unwrap_or(i64::MAX), since.subsec_nanos().into())
}

/// Returns true if two paths lead to existing files with the same creation time, time of last write (both in steps of 100 ns) and
/// length, like the two names that cargo gives a file. Not real-time.
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    let of = |path: &Path| {
        std::fs::metadata(path).map(|file| (file.creation_time(), file.last_write_time(), file.len()))
    };
    matches!((of(one), of(other)), (Ok(one), Ok(other)) if one == other)
}

/// Error text if the system does not report the path of this program.
pub(crate) const UNKNOWN_PROGRAM: &str =
    "the folder of this program is unknown; give plugin folders with --plugin-path";

/// Returns the plugin folder of the user, shared by all installations; `None` without `LOCALAPPDATA`.
pub(crate) fn user_folder() -> Option<PathBuf> {
    let local = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|path| path.is_absolute());
    Some(local?.join("flotor").join("plugins"))
}

/// Returns `None`: permissions of folders are not checked on this system.
pub(crate) fn distrust(_: &Path, _: &Metadata) -> Option<String> {
    None
}

/// Processor use of a thread, which is not measured yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Used {
    pub(crate) ran: std::time::Duration,
    pub(crate) wants: bool,
}

/// Reader of the processor use of one thread: not available yet.
pub struct ThreadClock;

impl ThreadClock {
    /// Creates a reader for the calling thread.
    #[must_use]
    pub fn of_this_thread() -> Self {
        Self
    }

    /// Returns `None`: not available yet.
    #[allow(clippy::unused_self)] // as on other systems
    pub(crate) fn used(&self) -> Option<Used> {
        None
    }
}
