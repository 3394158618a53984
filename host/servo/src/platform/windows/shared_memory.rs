//! Memory that two processes see. There is none yet.

use super::not_yet;
use crate::engine::process::SharedPage;
use std::io;
use std::os::windows::io::OwnedHandle;
use std::sync::atomic::AtomicU32;

/// A page that another process may have mapped too. There is none yet.
pub(crate) enum SharedMemory {}

/// Makes what is mapped. Not real-time.
///
/// # Errors
/// Always.
pub(crate) fn create_file() -> io::Result<OwnedHandle> {
    Err(not_yet("a model in a process of its own"))
}

impl SharedMemory {
    /// The memory that this process was given as its standard input. Not real-time.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn of_standard_input() -> io::Result<Self> {
        Err(not_yet("a model in a process of its own"))
    }

    /// Maps what [`create_file`] made. Not real-time.
    ///
    /// # Errors
    /// Always.
    pub(crate) fn map(_: &OwnedHandle) -> io::Result<Self> {
        Err(not_yet("a model in a process of its own"))
    }
}

impl std::ops::Deref for SharedMemory {
    type Target = SharedPage;

    fn deref(&self) -> &SharedPage {
        match *self {}
    }
}

/// Sleeps until `word` is no longer `value`: there is no such word.
pub(crate) fn wait_for_change(_: &AtomicU32, _: u32, _: u64) {}

/// Wakes the other process: there is none.
pub(crate) fn wake(_: &AtomicU32) {}
