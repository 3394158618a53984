//! What differs between systems for the viewer: what the process has cost so far, and where a user's settings are.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{processor, resident_mib, settings_folder};
#[cfg(windows)]
pub(crate) use windows::{processor, resident_mib, settings_folder};
