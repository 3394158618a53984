//! Device plugin for the Novint Falcon over raw USB: three driven axes and four buttons behind an FTDI chip.
//!
//! ```text
//! encoders -> angles -> Delta -> position          force -> Delta -> torques -> words
//!     ^                                                                          |
//!     +--------- frame <- bytes <- packets of the chip ~ USB ~ bytes <- frame <--+
//! ```
//!
//! The device loses its firmware at power-off. The user supplies the file; this plugin contains none.
//!
//! - [`protocol`]: commands and reports as frames of 16 bytes.
//! - [`kinematics`]: the delta linkage: from angles to the handle's position, from force to torques, and back.
//! - [`chip`]: the FTDI chip: its requests, and the status bytes in its packets.
//! - [`boot`]: the handshake with the boot loader, and the errors of a start.
//! - [`firmware`]: the user's firmware file.
//! - `usb`, `remote`: the chip on the bus, and an emulated chip over TCP.
//! - [`exchange`]: a reader thread, and a writer thread that keeps one command in flight.

pub mod boot;
pub mod chip;
mod device_error;
pub mod exchange;
pub mod firmware;
pub mod kinematics;
mod platform;
mod plugin;
pub mod protocol;
pub mod remote;
mod usb;

pub use device_error::DeviceError;
pub use plugin::{FLOTOR_ENTRY, FalconDevice};
