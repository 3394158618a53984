//! Novint Falcon without hardware: the FTDI chip, the boot loader and a firmware, with three connections to a host.
//!
//! ```text
//!                       +- InProcess: the plugin's trait of a chip, for tests
//! Machine (chip, loader, firmware, handle) -+- server: TCP, for the plugin in another process
//!                       +- gadget: this machine's own USB, for every program that drives a Falcon
//! ```
//!
//! - [`machine`]: behaviour of the device; pure, with a clock that is passed in.
//! - [`rig`]: a device in the rig for vertical calibration, whose motors deliver more or less force than commanded.
//!
//! Contains no firmware of the maker: any uploaded bytes are accepted, and the emulated firmware of [`machine`] runs.
//! Not real-time.

#[cfg(target_os = "linux")]
pub mod gadget;
pub mod in_process;
pub mod machine;
pub mod rig;
pub mod server;

pub use flotor_emulation::{clients, port};
