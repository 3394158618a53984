//! Unix: file system statistics.

use std::path::Path;

/// Returns the free bytes of an existing folder's disk, for this user; `None` if unknown. Not real-time.
pub(crate) fn free_bytes(folder: &Path) -> Option<f64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
