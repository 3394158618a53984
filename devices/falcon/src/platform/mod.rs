//! What differs between systems: what the user of a device on USB has to do, and the number of a connection.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{OTHER_REMEDY, access_remedy, descriptor, has_bus};
#[cfg(windows)]
pub(crate) use windows::{OTHER_REMEDY, access_remedy, descriptor, has_bus};
