//! Where running hosts are found: one socket a run, in a folder that belongs to the user alone.

use rustix::process::{Pid, getuid, test_kill_process};
use std::ffi::OsStr;
use std::fs::{DirBuilder, DirEntry, Metadata};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::SystemTime;

/// Ending of a socket's name.
const SUFFIX: &str = "run";
/// Nobody but the owner.
const PRIVATE: u32 = 0o700;

/// The folder of the sockets of running hosts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Directory {
    path: PathBuf,
}

/// A run that may be watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Its socket.
    pub path: PathBuf,
    /// The process that runs it.
    pub process: u32,
    /// Since when.
    pub since: SystemTime,
}

/// Why a run cannot be found by others.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DirectoryError {
    /// The folder cannot be made, or no socket in it.
    #[error("{}: {cause}; set XDG_RUNTIME_DIR to a folder you may write to", path.display())]
    Unusable {
        /// The folder or socket.
        path: PathBuf,
        /// What the system said.
        #[source]
        cause: io::Error,
    },
    /// Others may enter the folder: they could change a run.
    #[error("{}: unsafe permissions: other users may enter it and change a run; `chmod 700` it, and own it", path.display())]
    NotPrivate {
        /// The folder.
        path: PathBuf,
    },
}

impl Directory {
    /// `$XDG_RUNTIME_DIR/flotor`, else `/tmp/flotor-UID`.
    #[must_use]
    pub fn of_this_user() -> Self {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|path| Path::new(path).is_dir());
        let path = match runtime {
            Some(runtime) => Path::new(&runtime).join("flotor"),
            None => std::env::temp_dir().join(format!("flotor-{}", getuid().as_raw())),
        };
        Self { path }
    }

    /// Another folder.
    #[must_use]
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it is a folder of this user. Of another user's nothing is believed: in `/tmp` anybody can make one of this name.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        std::fs::symlink_metadata(&self.path).is_ok_and(|attributes| is_our_folder(&attributes))
    }

    /// The files in it; none in a folder of another user.
    #[must_use]
    pub fn files(&self) -> Vec<DirEntry> {
        let entries = self.is_ours().then(|| std::fs::read_dir(&self.path).ok()).flatten();
        entries.into_iter().flatten().flatten().collect()
    }

    /// Runs of processes that live, the newest first. Sockets of dead ones are removed on the way.
    #[must_use]
    pub fn runs(&self) -> Vec<Found> {
        let mut runs: Vec<Found> = (self.files().into_iter())
            .filter_map(|entry| {
                let path = entry.path();
                let process = process_of(&path)?;
                if !lives(process) {
                    let _ = std::fs::remove_file(&path); // somebody else may have been faster
                    return None;
                }
                let since = entry.metadata().ok()?.modified().ok()?;
                Some(Found { path, process, since })
            })
            .collect();
        runs.sort_by(|a, b| (b.since, &b.path).cmp(&(a.since, &a.path)));
        runs
    }

    /// Makes the folder if need be, for this user alone.
    ///
    /// # Errors
    /// [`DirectoryError`]: the folder is not usable, or not ours alone.
    pub fn make(&self) -> Result<(), DirectoryError> {
        private(&self.path)
    }

    /// Makes the folder if need be, and a socket of this process in it.
    ///
    /// # Errors
    /// [`DirectoryError`]: the folder is not usable, or not ours alone.
    pub fn listen(&self) -> Result<Listener, DirectoryError> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        private(&self.path)?;
        let _ = self.runs(); // cleans up
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = self.path.join(format!("{}-{number}.{SUFFIX}", std::process::id()));
        // A process of this number may have died without cleaning up.
        let _ = std::fs::remove_file(&path);
        let socket = UnixListener::bind(&path).map_err(unusable(&path))?;
        Ok(Listener { socket, path })
    }
}

/// A socket that others can find; gone when dropped.
#[derive(Debug)]
pub struct Listener {
    socket: UnixListener,
    path: PathBuf,
}

impl Listener {
    /// The socket.
    #[must_use]
    pub fn socket(&self) -> &UnixListener {
        &self.socket
    }

    /// Its file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Makes a folder that only its user may enter, if it is not there.
pub(crate) fn private(path: &Path) -> Result<(), DirectoryError> {
    DirBuilder::new().recursive(true).mode(PRIVATE).create(path).map_err(unusable(path))?;
    let attributes = std::fs::symlink_metadata(path).map_err(unusable(path))?;
    if is_our_folder(&attributes) && attributes.mode() & 0o077 == 0 {
        Ok(())
    } else {
        Err(DirectoryError::NotPrivate { path: path.to_path_buf() })
    }
}

fn is_our_folder(attributes: &Metadata) -> bool {
    attributes.is_dir() && attributes.uid() == getuid().as_raw()
}

pub(crate) fn unusable(path: &Path) -> impl FnOnce(io::Error) -> DirectoryError {
    let path = path.to_path_buf();
    move |cause| DirectoryError::Unusable { path, cause }
}

/// The process whose socket this is.
fn process_of(path: &Path) -> Option<u32> {
    let name = path.file_stem()?.to_str()?;
    let (process, _) = name.split_once('-')?;
    (path.extension() == Some(OsStr::new(SUFFIX))).then(|| process.parse().ok())?
}

/// Whether a process exists; one of somebody else's counts.
pub(crate) fn lives(process: u32) -> bool {
    let Some(process) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return false };
    test_kill_process(process) != Err(rustix::io::Errno::SRCH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_run_is_found_while_it_lives() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        assert_eq!(directory.runs(), []);
        let (first, second) = (directory.listen().unwrap(), directory.listen().unwrap());
        let mut found: Vec<PathBuf> = directory.runs().into_iter().map(|run| run.path).collect();
        found.sort();
        assert_eq!(found, [first.path(), second.path()]);
        drop(first);
        assert_eq!(directory.runs().len(), 1);
    }

    #[test]
    fn what_the_dead_left_behind_is_removed_and_nothing_else() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path());
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let stale = scratch.path().join(format!("{}-0.run", child.id()));
        let other = scratch.path().join("notes.txt");
        std::fs::write(&stale, "").unwrap();
        std::fs::write(&other, "").unwrap();
        assert_eq!(directory.runs(), []);
        assert!(!stale.exists() && other.exists());
    }

    #[test]
    fn a_folder_that_others_may_enter_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        std::fs::set_permissions(scratch.path(), std::fs::Permissions::from_mode(0o755)).unwrap();
        let refused = Directory::at(scratch.path()).listen();
        assert!(matches!(refused, Err(DirectoryError::NotPrivate { .. })), "{refused:?}");
    }

    /// Who made the folder first wrote what this user's runs obeyed, and showed runs of its own.
    #[test]
    fn of_a_folder_of_another_user_nothing_is_believed() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("flotor"));
        let run = directory.listen().unwrap();
        let peer = scratch.path().join(format!("flotor/{}-pair.peer", std::process::id()));
        std::fs::write(peer, "").unwrap();
        directory.latch().press("a stranger").unwrap();
        let seen = |directory: &Directory| {
            let pressed = directory.latch().state().pressed.is_some();
            (directory.runs().len(), directory.couplings().len(), pressed)
        };
        assert_eq!(seen(&directory), (1, 1, true));
        // Only root can give it away; by a link to it nobody gets further.
        if getuid().is_root() {
            std::os::unix::fs::chown(directory.path(), Some(65534), None).unwrap();
            assert_eq!(seen(&directory), (0, 0, false));
            std::os::unix::fs::chown(directory.path(), Some(0), None).unwrap();
        }
        let link = Directory::at(scratch.path().join("link"));
        std::os::unix::fs::symlink(directory.path(), link.path()).unwrap();
        assert_eq!(seen(&link), (0, 0, false));
        drop(run);
    }
}
