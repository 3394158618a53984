//! Device plugin for a force sensor on a serial port: measures a vertical force and exerts none.
//!
//! ```text
//! host: R  ->  sensor: F 1.234   (N, upwards positive)
//! ```
//!
//! The device senses no pose and drives no axis; its measurement is the `delivered` force of its state.
//! `flotor calibrate vertical` reads the sensor, and a scene may include the sensor as a further device, so that a
//! recording contains the measured force on a handle.
//!
//! - [`protocol`]: requests and replies as bytes.
//! - [`mod@line`]: one request at a time over a serial port.
//! - `plugin`: parameters and the contract.

pub mod line;
mod plugin;
pub mod protocol;

pub use plugin::{FLOTOR_ENTRY, ForceSensor};
