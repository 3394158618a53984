//! What differs between systems: how a process keeps others from writing to its file.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::open_alone;
#[cfg(windows)]
pub(crate) use windows::open_alone;
