//! Windows: a file has the rights of its folder.

use std::fs::File;
use std::io;

/// Rules that the system cannot check: they pass with a note.
pub(crate) const UNTOLD_RULES: &[&str] =
    &["no-threads", "host-untouched", "inside-memory", "no-system-calls"];

/// A scratch file too is for those who may read its folder.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub(crate) fn readable_by_all(_: &File) -> io::Result<()> {
    Ok(())
}
