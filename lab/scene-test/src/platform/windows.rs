//! Windows: a file has the rights of its folder.

use std::fs::File;
use std::io;

/// A scratch file too is for those who may read its folder.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub(crate) fn readable_by_all(_: &File) -> io::Result<()> {
    Ok(())
}
