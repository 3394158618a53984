//! The magnetic-levitation haptic device: the plugin and its wire protocol.
//!
//! ```text
//! host <-> plugin -> boundary -> calibration -> protocol -> transport ~~~ controller -> limits -> coils
//! ```
//!
//! - [`protocol`]: frames of 64 bytes, and which of them may be acted on.
//! - [`ml_api`]: the ML API of the Maglev 200, the other protocol a controller may speak.
//! - [`transport`]: what carries them: TCP, serial, USB, HID.
//! - [`boundary`]: walls and angle limits on the host's side.
//! - [`warning`]: when the person who holds it should be warned.
//! - [`facts`]: what is published about the device.
//!
//! The controller at the other end is a crate of its own: `flotor-maglev-emulator`.

pub mod boundary;
pub mod facts;
mod flight;
mod host_link;
pub mod ml_api;
mod ml_client;
mod ml_device;
mod own_device;
mod parameters;
mod platform;
mod plugin;
pub mod protocol;
mod shaping;
pub mod transport;
pub mod warning;

pub use plugin::{FLOTOR_ENTRY, LevitatingDevice, MaglevDevice};
