//! Parts that differ between systems: detection of a USB bus, remedies for USB errors, and the descriptor of a connection.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{OTHER_REMEDY, access_remedy, descriptor, has_bus};
#[cfg(windows)]
pub(crate) use windows::{OTHER_REMEDY, access_remedy, descriptor, has_bus};
