//! Emulator of the maglev device's controller.
//!
//! - [`controller`]: the firmware as a state machine, with the final limits on the coils.
//! - [`Emulator`]: the firmware with a [`Plant`], serving a host on any transport of the plugin.
//! - [`ml_api`]: the controller of the Maglev 200 as seen by its clients.
//! - `gadget`: the firmware as an emulated USB device of this machine (Linux).
//!
//! The crate uses the plugin's protocol and transports.

pub mod controller;
mod emulator;
#[cfg(target_os = "linux")]
pub mod gadget;
pub mod ml_api;

pub use flotor_emulation::port;

pub use emulator::{Emulator, Event, Pace, Plant, controller_config};
