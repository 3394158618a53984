//! Unix: statistics of a file system.

use std::path::Path;

/// Bytes that this user may still write to the disk of a folder that exists. Not real-time.
pub(crate) fn free_bytes(folder: &Path) -> Option<f64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
