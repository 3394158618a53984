//! The magnetic-levitation haptic device: the plugin and its wire protocol.
//!
//! ```text
//! host <-> plugin -> boundary -> calibration -> protocol -> transport ~~~ controller -> limits -> coils
//! ```
//!
//! - [`protocol`]: frames of 64 bytes and their replay protection.
//! - [`ml_api`]: the ML API of the Maglev 200, the alternative protocol of a controller.
//! - [`transport`]: links for frames: TCP, serial, USB, HID.
//! - [`boundary`]: walls and angle limits on the host's side.
//! - [`warning`]: warning of excess force.
//! - [`facts`]: published numbers of the device.
//!
//! The emulated controller is in the crate `flotor-maglev-emulator`.

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
