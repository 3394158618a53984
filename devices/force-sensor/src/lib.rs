//! A force sensor on a serial port: a device that measures a vertical force and exerts none.
//!
//! ```text
//! host: R  ->  sensor: F 1.234   (N, upwards positive)
//! ```
//!
//! It senses no pose and drives no axis; what it measures is the `delivered` force of its state. `flotor calibrate vertical`
//! reads it, and a scene may hold it as one more device, so that a recording has what a handle really pressed with.
//!
//! - [`protocol`]: questions and answers as bytes.
//! - [`mod@line`]: one question at a time over a serial port.
//! - `plugin`: parameters and the contract.

pub mod line;
mod plugin;
pub mod protocol;

pub use plugin::{FLOTOR_ENTRY, ForceSensor};
