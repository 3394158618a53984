//! A Novint Falcon without hardware: the FTDI chip, the boot loader and a firmware, on three ways to a host.
//!
//! ```text
//!                       +- InProcess: the plugin's trait of a chip, for tests
//! Machine (chip, loader, firmware, handle) -+- server: TCP, for the plugin in another process
//!                       +- gadget: this machine's own USB, for every program that drives a Falcon
//! ```
//!
//! - [`machine`]: what the device does; pure, with a clock that is passed in.
//! - [`rig`]: a device in the rig of the vertical calibration, whose motors deliver less or more than they are told.
//! - [`in_process`], [`server`], [`gadget`]: the three ways.
//!
//! It has no firmware of the maker's: any bytes are loaded and run the one that is written here. Not real-time.

#[cfg(target_os = "linux")]
pub mod gadget;
pub mod in_process;
pub mod machine;
pub mod rig;
pub mod server;

pub use flotor_emulation::{clients, port};
