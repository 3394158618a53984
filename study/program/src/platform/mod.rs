//! Free disk space, per operating system.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::free_bytes;
#[cfg(windows)]
pub(crate) use windows::free_bytes;
