//! The magnetic-levitation haptic device: the plugin, its wire protocol, and the controller at the other end.
//!
//! ```text
//! host <-> plugin -> boundary -> calibration -> protocol -> transport ~~~ controller -> limits -> coils
//! ```
//!
//! - [`protocol`]: frames of 64 bytes, and which of them may be acted on.
//! - [`transport`]: what carries them: TCP, serial, USB, HID.
//! - [`boundary`]: walls and angle limits on the host's side.
//! - [`warning`]: when the person who holds it should be warned.
//! - [`controller`]: the firmware as a state machine; the authority over the coils.
//! - [`emulator`]: the controller without hardware, for tests and for authors of other plugins.
//! - `gadget`: that controller as a USB device of this machine's own kernel (Linux).
//! - [`facts`]: what is published about the device.
//!
//! The plugin links none of the controller; the emulator links none of the plugin.

pub mod boundary;
pub mod controller;
pub mod emulator;
pub mod facts;
mod flight;
#[cfg(target_os = "linux")]
pub mod gadget;
mod host_link;
mod parameters;
mod plugin;
pub mod protocol;
pub mod transport;
pub mod warning;

pub use plugin::{FLOTOR_ENTRY, LevitatingDevice, MaglevDevice};
