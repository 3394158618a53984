//! Linux: a lock on the file. The kernel releases it with the last descriptor, so after every end of the process.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Error, ErrorKind};
use std::path::Path;

/// Opens a file that no other writer opens while this one is open; `None` if another has it. A file system without locks gives the
/// file to all.
///
/// # Errors
/// What the system says.
pub(crate) fn open_alone(options: &OpenOptions, path: &Path) -> Result<Option<File>, Error> {
    let file = options.open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(cause)) if cause.kind() == ErrorKind::Unsupported => Ok(Some(file)),
        Err(TryLockError::Error(cause)) => Err(cause),
    }
}
