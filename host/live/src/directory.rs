//! Where running hosts are found: one socket a run, in a folder that belongs to the user alone.

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

/// Ending of a socket's name.
const SUFFIX: &str = "run";

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
    #[error("{}: {cause}; {}", path.display(), remedy(cause))]
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

/// Number set for this process; 0 if none is.
static PROCESS_NUMBER: AtomicU32 = AtomicU32::new(0);

/// Gives this process the number of the process that started it and ends with it: users know that one. Not real-time.
pub fn set_process_number(number: u32) {
    PROCESS_NUMBER.store(number, Ordering::Relaxed);
}

/// Returns the number by which others know this process. Not real-time.
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
        _ if is_out_of_descriptors(cause) => "close some, or allow more (`ulimit -n`)",
        _ => "set XDG_RUNTIME_DIR to a folder you may write to",
    }
}

impl Directory {
    /// `$XDG_RUNTIME_DIR/flotor`, else `/tmp/flotor-UID`; on Windows `%LOCALAPPDATA%\\flotor\\run`.
    #[must_use]
    pub fn of_this_user() -> Self {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|path| Path::new(path).is_dir());
        Self { path: runtime.map_or_else(run_folder, |runtime| Path::new(&runtime).join("flotor")) }
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
        std::fs::symlink_metadata(&self.path).is_ok_and(|attributes| is_ours(&attributes))
    }

    /// The files in it; none in a folder of another user.
    #[must_use]
    pub fn files(&self) -> Vec<DirEntry> {
        self.list().unwrap_or_default()
    }

    /// The files in it; none if there is no folder.
    fn list(&self) -> io::Result<Vec<DirEntry>> {
        match std::fs::symlink_metadata(&self.path) {
            Ok(attributes) if is_ours(&attributes) => std::fs::read_dir(&self.path)?.collect(),
            Ok(_) => Err(io::ErrorKind::PermissionDenied.into()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Runs whose sockets are open, the newest first; none where they cannot be listed. Removes the files of the other sockets.
    #[must_use]
    pub fn runs(&self) -> Vec<Found> {
        self.try_runs().unwrap_or_default()
    }

    /// As [`Directory::runs`].
    ///
    /// # Errors
    /// [`DirectoryError::Unusable`]: the folder cannot be read, or is another user's.
    pub fn try_runs(&self) -> Result<Vec<Found>, DirectoryError> {
        let mut runs: Vec<Found> = (self.list().map_err(unusable(&self.path))?.into_iter())
            .filter_map(|entry| {
                let path = entry.path();
                let process = process_of(&path)?;
                if remove_if_dead(&path) {
                    return None;
                }
                let since = entry.metadata().ok()?.modified().ok()?;
                Some(Found { path, process, since })
            })
            .collect();
        runs.sort_by(|a, b| (b.since, &b.path).cmp(&(a.since, &a.path)));
        Ok(runs)
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
        let _ = self.runs(); // removes what is dead
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = self.path.join(format!("{}-{number}.{SUFFIX}", process_number()));
            match Listening::bind(&path) {
                Ok(socket) => {
                    let file = std::fs::symlink_metadata(&path).ok();
                    return Ok(Listener { socket: Arc::new(socket), path, file });
                }
                // A run of the same process number, in another container.
                Err(error) if error.kind() == io::ErrorKind::AddrInUse => {}
                Err(error) => return Err(unusable(&path)(error)),
            }
        }
    }
}

/// A socket that others can find; gone when dropped.
#[derive(Debug)]
pub struct Listener {
    socket: Arc<Listening>,
    path: PathBuf,
    /// Its file as it was made.
    file: Option<Metadata>,
}

impl Listener {
    /// The socket.
    #[must_use]
    pub(crate) fn socket(&self) -> &Arc<Listening> {
        &self.socket
    }

    /// Waits for the next connection, without an end.
    ///
    /// # Errors
    /// The error of the system; `Interrupted` for a client that was turned away.
    pub fn accept(&self) -> io::Result<Stream> {
        self.socket.accept()?.ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    /// Its file.
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

/// Makes a folder that only its user may enter, if it is not there.
pub(crate) fn private(path: &Path) -> Result<(), DirectoryError> {
    make_folder(path).map_err(unusable(path))?;
    let attributes = std::fs::symlink_metadata(path).map_err(unusable(path))?;
    if is_ours_alone(&attributes) {
        Ok(())
    } else {
        Err(DirectoryError::NotPrivate { path: path.to_path_buf() })
    }
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
