//! What differs between systems for a test of scenes: who may read a result.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::readable_by_all;
#[cfg(windows)]
pub(crate) use windows::readable_by_all;
