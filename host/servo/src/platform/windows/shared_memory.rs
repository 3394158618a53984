//! Shared memory of two processes: not available on this system yet.

use super::no_workers;
use crate::engine::process::SharedPage;
use std::io;
use std::os::windows::io::OwnedHandle;
use std::sync::atomic::AtomicU32;

/// Page that another process may have mapped too: not available yet.
pub(crate) enum SharedMemory {}

/// Returns an error: worker processes are not available yet. Not real-time.
///
/// # Errors
/// Always.
pub(crate) fn create_file() -> io::Result<OwnedHandle> {
    Err(no_workers())
}

impl SharedMemory {
    /// Returns an error: worker processes are not available yet. Not real-time.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn of_standard_input() -> io::Result<Self> {
        Err(no_workers())
    }

    /// Returns an error: worker processes are not available yet. Not real-time.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn map(_: &OwnedHandle) -> io::Result<Self> {
        Err(no_workers())
    }
}

impl std::ops::Deref for SharedMemory {
    type Target = SharedPage;

    fn deref(&self) -> &SharedPage {
        match *self {}
    }
}

/// Returns at once: no word is shared.
pub(crate) fn wait_for_change(_: &AtomicU32, _: u32, _: u64) {}

/// Does nothing: there is no other process.
pub(crate) fn wake(_: &AtomicU32) {}
