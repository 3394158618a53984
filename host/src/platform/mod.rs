//! Platform layer of the `flotor` command. Each system has one module with the same items:
//! - `doctor`, `usb`: diagnosis of the operating system and of USB devices;
//! - `check_lend`: check that `flotor lend` is supported;
//! - `most_open_files`, `end_with_parent`: limit on open files, and end of the process with its parent;
//! - `C_COMPILER`, `canonical`: command that builds a plugin in C, if other than `cc`, and absolute paths in a form for cargo.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{C_COMPILER, canonical, check_lend, doctor, end_with_parent, most_open_files, usb};
#[cfg(windows)]
pub(crate) use windows::{C_COMPILER, canonical, check_lend, doctor, end_with_parent, most_open_files, usb};
