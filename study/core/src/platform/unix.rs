//! Unix: exclusive write access by a file lock, which the kernel releases when the process ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind};
use std::path::Path;

/// Opens a file with exclusive write access; returns `None` if another writer has the file locked. If the file system does not
/// support locks, access is not exclusive.
///
/// # Errors
/// If the file cannot be opened or locked.
pub(crate) fn open_alone(options: &OpenOptions, path: &Path) -> Result<Option<File>, Error> {
    let file = options.open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(cause)) if cause.kind() == ErrorKind::Unsupported => Ok(Some(file)),
        Err(TryLockError::Error(cause)) => Err(cause),
    }
}
