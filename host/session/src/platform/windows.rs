//! Windows: the working folder, times of files. Rights of folders are not looked at yet.

use std::fs::Metadata;
use std::os::windows::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// What ends this process without a stop of the devices, though another system catches it: for people.
pub(crate) const NOT_CAUGHT: Option<&str> = Some(
    "on Windows nothing stops a device if a plugin ends this program by `abort` or damages its memory (heap corruption), or if it is \
     ended from outside (Task Manager); keep a hand at the power switch",
);

/// The state of the process that plugins share with the host: the working folder. Limits of a process are set from outside, and no
/// thread of a plugin has another's priority in its reach by a number that it knows.
pub(crate) struct MachineState {
    folder: Option<PathBuf>,
}

impl MachineState {
    /// As it is. Not real-time.
    pub(crate) fn now() -> Self {
        Self { folder: std::env::current_dir().ok() }
    }

    /// Puts back what is different now: its names. What the system refuses to put back is named all the same. Not
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

/// What tells a file from others of its name: when it was made.
pub(crate) fn identity(file: &Metadata) -> [u64; 2] {
    [file.creation_time(), u64::from(file.file_attributes())]
}

/// When the contents changed last, s and ns since 1970. A program can set it back; the length and the file's beginning have to fit
/// as well.
pub(crate) fn changed(file: &Metadata) -> (i64, i64) {
    let since = file.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    (i64::try_from(since.as_secs()).unwrap_or(i64::MAX), since.subsec_nanos().into())
}

/// Whether two paths lead to one file that exists: made and written at the same 100 ns, and of one length, as the two names are
/// that cargo gives a file. Not real-time.
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    let of = |path: &Path| {
        std::fs::metadata(path).map(|file| (file.creation_time(), file.last_write_time(), file.len()))
    };
    matches!((of(one), of(other)), (Ok(one), Ok(other)) if one == other)
}

/// Cause of a program whose place the system does not tell.
pub(crate) const UNKNOWN_PROGRAM: &str = "the folder of this program is unknown; name folders of plugins";

/// Where a user keeps plugins for all installations.
pub(crate) fn user_folder() -> Option<PathBuf> {
    let local = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|path| path.is_absolute());
    Some(local?.join("flotor").join("plugins"))
}

/// Why a folder is not searched: never. Whoever may write into a folder is not looked at on this system.
pub(crate) fn distrust(_: &Path, _: &Metadata) -> Option<String> {
    None
}

/// Use of the processors by a thread, which nobody reads yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Used {
    pub(crate) ran: std::time::Duration,
    pub(crate) wants: bool,
}

/// Reads the use of the processors by one thread: not yet.
pub struct ThreadClock;

impl ThreadClock {
    /// That of the calling thread.
    #[must_use]
    pub fn of_this_thread() -> Self {
        Self
    }

    /// Reads it: the system is not asked yet.
    #[allow(clippy::unused_self)] // as on other systems
    pub(crate) fn used(&self) -> Option<Used> {
        None
    }
}

/// Changes nothing: a process outlives the one that started it.
pub fn end_with_this_thread(_: &mut std::process::Command) {}

/// A process that ends with its parent: here its group is the process itself, and nothing ends it with a parent that is killed.
pub(crate) mod process_group {
    use std::io;
    use std::process::{Child, Command};

    /// Changes nothing.
    pub(crate) fn lead_until_parent_ends(_: &mut Command) {}

    /// Whether a child has ended.
    pub(crate) fn has_ended(child: &mut Child) -> io::Result<bool> {
        Ok(child.try_wait()?.is_some())
    }

    /// Kills a child.
    pub(crate) fn kill(child: &mut Child) {
        let _ = child.kill();
    }
}
