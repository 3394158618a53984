//! The controller at the other end of the maglev device's link, without hardware.
//!
//! - [`controller`]: the firmware as a state machine; the authority over the coils.
//! - [`Emulator`]: that controller over a [`Plant`], serving a host on any transport of the plugin.
//! - [`ml_api`]: the controller of the Maglev 200 as its own clients see it.
//! - `gadget`: that controller as a USB device of this machine's own kernel (Linux).
//!
//! Of the plugin it uses the protocol and the transports.

pub mod controller;
mod emulator;
#[cfg(target_os = "linux")]
pub mod gadget;
pub mod ml_api;

pub use flotor_emulation::port;

pub use emulator::{Emulator, Event, Pace, Plant, controller_config};
