//! What differs between systems for the `flotor` command. Each system has one module with the same items:
//! - `doctor`, `usb`: what the system tells of itself and of devices on USB;
//! - `lend`: programs of other makers;
//! - `most_open_files`, `end_with_parent`: the process;
//! - `C_COMPILER`, `canonical`: what builds a plugin in C, where it is not `cc`, and a path that cargo reads.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{C_COMPILER, canonical, doctor, end_with_parent, lend, most_open_files, usb};
#[cfg(windows)]
pub(crate) use windows::{C_COMPILER, canonical, doctor, end_with_parent, lend, most_open_files, usb};
