//! What differs between systems for the commands of experiments: the free space of a disk.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::free_bytes;
#[cfg(windows)]
pub(crate) use windows::free_bytes;
