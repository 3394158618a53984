//! Windows: a share mode, which refuses other writers and admits readers.

use std::fs::{File, OpenOptions};
use std::io::Error;
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;

const FILE_SHARE_READ: u32 = 1;
const ERROR_SHARING_VIOLATION: i32 = 32;

/// Opens a file that no other writer opens while this one is open; `None` if another has it.
///
/// # Errors
/// What the system says.
pub(crate) fn open_alone(options: &OpenOptions, path: &Path) -> Result<Option<File>, Error> {
    match options.clone().share_mode(FILE_SHARE_READ).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(cause) if cause.raw_os_error() == Some(ERROR_SHARING_VIOLATION) => Ok(None),
        Err(cause) => Err(cause),
    }
}
