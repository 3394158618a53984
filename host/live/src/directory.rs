//! Discovery of running hosts: one socket per run, in a folder that belongs to the user alone.

use crate::platform::{
    Listening, Stream, is_ours, is_ours_alone, is_out_of_descriptors, is_same_file, make_folder,
    remove_if_dead, run_folder,
};
use std::ffi::OsStr;
use std::fs::{DirEntry, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::SystemTime;

/// Extension of a run's socket file.
const SUFFIX: &str = "run";

/// Folder with the sockets of running hosts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Directory {
    path: PathBuf,
}

/// Run with an open socket in the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundRun {
    /// Socket of the run.
    pub path: PathBuf,
    /// Process id of the run, as in the name of the socket file ([`process_number`]).
    pub process: u32,
    /// Start of the run.
    pub since: SystemTime,
}

/// Reason why other programs cannot find a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DirectoryError {
    /// The folder, or a file or socket in the folder, cannot be created, read or written.
    #[error("{}: {cause}; {}", path.display(), remedy(cause))]
    Unusable {
        /// Path of the folder, file or socket.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: io::Error,
    },
    /// The folder is a link, or another user owns it or may enter it, and could change a run.
    #[error(
        "{}: not safe for runs: it is a link, or another user owns the folder or may enter it; remove the link, \
         or become the owner and run `chmod 700` on the folder", .0.display())]
    NotPrivate(PathBuf),
}

/// Id set by [`set_process_number`]; 0: none.
static PROCESS_NUMBER: AtomicU32 = AtomicU32::new(0);

/// Sets the process id that other programs see for this process: the id of its supervisor, which users see too. Not real-time.
pub fn set_process_number(number: u32) {
    PROCESS_NUMBER.store(number, Ordering::Relaxed);
}

/// Returns the process id that other programs see: the id from [`set_process_number`], else this process's own. Not real-time.
#[must_use]
pub fn process_number() -> u32 {
    match PROCESS_NUMBER.load(Ordering::Relaxed) {
        0 => std::process::id(),
        number => number,
    }
}

/// Returns the remedy for a folder or socket that cannot be used.
fn remedy(cause: &io::Error) -> &'static str {
    match cause.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room on its disk",
        io::ErrorKind::InvalidInput => "set XDG_RUNTIME_DIR to a folder with a shorter path",
        _ if is_out_of_descriptors(cause) => "close some files, or allow more (`ulimit -n`)",
        _ => "set XDG_RUNTIME_DIR to a folder you may write to",
    }
}

impl Directory {
    /// Returns the folder of this user: `$XDG_RUNTIME_DIR/flotor` if the variable names a folder, else `flotor-UID` in the folder
    /// for temporary files (on Windows, `flotor/run` in `%LOCALAPPDATA%`).
    #[must_use]
    pub fn of_this_user() -> Self {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|path| Path::new(path).is_dir());
        Self { path: runtime.map_or_else(run_folder, |runtime| Path::new(&runtime).join("flotor")) }
    }

    /// Returns a handle of the folder at `path`, without creating the folder.
    #[must_use]
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Returns the path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the folder exists, is not a link and belongs to this user (on Windows the owner is not checked). Other
    /// folders are not trusted: in `/tmp` any user can create a folder of this name.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        std::fs::symlink_metadata(&self.path).is_ok_and(|attributes| is_ours(&attributes))
    }

    /// Returns the files in the folder; none if the folder is missing, cannot be read or belongs to another user.
    #[must_use]
    pub fn files(&self) -> Vec<DirEntry> {
        self.list().unwrap_or_default()
    }

    /// Lists the files in the folder; none if there is no folder.
    fn list(&self) -> io::Result<Vec<DirEntry>> {
        match std::fs::symlink_metadata(&self.path) {
            Ok(attributes) if is_ours(&attributes) => std::fs::read_dir(&self.path)?.collect(),
            Ok(_) => Err(io::ErrorKind::PermissionDenied.into()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Returns the runs whose sockets are open, the newest first; none if the folder cannot be read. Removes the files of closed sockets.
    #[must_use]
    pub fn runs(&self) -> Vec<FoundRun> {
        self.try_runs().unwrap_or_default()
    }

    /// Returns the runs whose sockets are open, the newest first; none without a folder. Removes the files of closed sockets.
    ///
    /// # Errors
    /// [`DirectoryError::Unusable`] if the folder cannot be read, or belongs to another user.
    pub fn try_runs(&self) -> Result<Vec<FoundRun>, DirectoryError> {
        let mut runs: Vec<FoundRun> = (self.list().map_err(unusable(&self.path))?.into_iter())
            .filter_map(|entry| {
                let path = entry.path();
                let process = process_of(&path)?;
                if remove_if_dead(&path) {
                    return None;
                }
                let since = entry.metadata().ok()?.modified().ok()?;
                Some(FoundRun { path, process, since })
            })
            .collect();
        runs.sort_by(|a, b| (b.since, &b.path).cmp(&(a.since, &a.path)));
        Ok(runs)
    }

    /// Creates the folder if necessary, accessible to this user only.
    ///
    /// # Errors
    /// If the folder cannot be created, belongs to another user, or other users may enter it.
    pub fn make(&self) -> Result<(), DirectoryError> {
        private(&self.path)
    }

    /// Creates the folder if necessary, and in it a listening socket of this process, with a unique file name.
    ///
    /// # Errors
    /// If the folder or the socket cannot be created, or other users may enter the folder.
    pub fn listen(&self) -> Result<Listener, DirectoryError> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        private(&self.path)?;
        let _ = self.runs(); // removes closed sockets
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = self.path.join(format!("{}-{number}.{SUFFIX}", process_number()));
            match Listening::bind(&path) {
                Ok(socket) => {
                    let file = std::fs::symlink_metadata(&path).ok();
                    return Ok(Listener { socket: Arc::new(socket), path, file });
                }
                // A run with the same process id, in another container.
                Err(error) if error.kind() == io::ErrorKind::AddrInUse => {}
                Err(error) => return Err(unusable(&path)(error)),
            }
        }
    }
}

/// Listening socket that other programs can find; dropping it removes the socket file.
#[derive(Debug)]
pub struct Listener {
    pub(crate) socket: Arc<Listening>,
    path: PathBuf,
    /// Metadata of the socket file after its creation.
    file: Option<Metadata>,
}

impl Listener {
    /// Waits for the next connection of a client, without a timeout.
    ///
    /// # Errors
    /// Errors of the system; `Interrupted` if a client was rejected, `NotConnected` if the socket has been closed.
    pub fn accept(&self) -> io::Result<Stream> {
        self.socket.accept()?.ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    /// Returns the path of the socket file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let there = std::fs::symlink_metadata(&self.path);
        let is_own = there.is_ok_and(|there| self.file.as_ref().is_some_and(|own| is_same_file(own, &there)));
        if is_own {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Creates a folder that only this user may enter, if necessary; returns an error if other users may enter an existing
/// folder.
pub(crate) fn private(path: &Path) -> Result<(), DirectoryError> {
    make_folder(path).map_err(unusable(path))?;
    let attributes = std::fs::symlink_metadata(path).map_err(unusable(path))?;
    let is_private = is_ours_alone(&attributes);
    if is_private { Ok(()) } else { Err(DirectoryError::NotPrivate(path.to_path_buf())) }
}

pub(crate) fn unusable(path: &Path) -> impl FnOnce(io::Error) -> DirectoryError {
    let path = path.to_path_buf();
    move |cause| DirectoryError::Unusable { path, cause }
}

/// Returns the process id in the name of a run's socket file; `None` for other files.
fn process_of(path: &Path) -> Option<u32> {
    let name = path.file_stem()?.to_str()?;
    let (process, _) = name.split_once('-')?;
    (path.extension() == Some(OsStr::new(SUFFIX))).then(|| process.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_cannot_be_used_has_the_remedy_of_its_cause() {
        for (cause, remedy) in
            [(io::ErrorKind::StorageFull, "make room"), (io::ErrorKind::PermissionDenied, "XDG_RUNTIME_DIR")]
        {
            let cause = io::Error::from(cause);
            let error = DirectoryError::Unusable { path: PathBuf::from("/run"), cause };
            assert!(error.to_string().contains(remedy), "{error}");
        }
    }

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
}
