//! What differs between systems for the commands of experiments: how much of a disk is free.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::free_bytes;
#[cfg(windows)]
pub(crate) use windows::free_bytes;
