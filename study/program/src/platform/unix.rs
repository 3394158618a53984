//! Unix: file system statistics.

use std::path::Path;

/// Returns the disk space available to this user in the file system of an existing folder, bytes; `None` if unknown. Not
/// real-time.
pub(crate) fn free_bytes(folder: &Path) -> Option<f64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
