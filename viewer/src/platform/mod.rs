//! System-dependent functions of the viewer: processor time, memory, and the user's settings folder.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{processor, resident_mib, settings_folder};
#[cfg(windows)]
pub(crate) use windows::{processor, resident_mib, settings_folder};
