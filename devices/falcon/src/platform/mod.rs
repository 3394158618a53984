//! What differs between systems for a device on USB: what its user has to do.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{OTHER_REMEDY, access_remedy};
#[cfg(windows)]
pub(crate) use windows::{OTHER_REMEDY, access_remedy};
