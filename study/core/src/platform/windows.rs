//! Windows: exclusive write access by a share mode that rejects other writers and permits readers.

use std::fs::{File, OpenOptions};
use std::io::Error;
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;

const FILE_SHARE_READ: u32 = 1;
const ERROR_SHARING_VIOLATION: i32 = 32;

/// Opens a file with exclusive write access; returns `None` if another writer has it open.
///
/// # Errors
/// If the file cannot be opened.
pub(crate) fn open_alone(options: &OpenOptions, path: &Path) -> Result<Option<File>, Error> {
    match options.clone().share_mode(FILE_SHARE_READ).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(cause) if cause.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => Ok(None),
        Err(cause) => Err(cause),
    }
}
