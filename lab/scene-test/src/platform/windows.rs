//! Windows: a file inherits the permissions of its folder.

use std::fs::File;
use std::io;

/// Does nothing: a temporary file has the permissions of its folder too.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub(crate) fn readable_by_all(_: &File) -> io::Result<()> {
    Ok(())
}
