//! System interface of the scene tests: read permission of results.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::readable_by_all;
#[cfg(windows)]
pub(crate) use windows::readable_by_all;
