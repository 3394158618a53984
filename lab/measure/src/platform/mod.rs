//! System interface of the measurements: waiting on a word that two processes may share.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{wait, wake};
#[cfg(windows)]
pub(crate) use windows::{wait, wake};
