//! Parts of HID access that differ between systems: device paths and remedies.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{ACCESS_REMEDY, PATH_EXAMPLE, PATH_HELP, is_refused};
#[cfg(windows)]
pub(crate) use windows::{ACCESS_REMEDY, PATH_EXAMPLE, PATH_HELP, is_refused};
