//! Device plugin for Force Dimension's devices, over the SDK that the user has installed: no part of the SDK belongs to Flotor.
//!
//! The SDK's calls that set a force wait for the exchange with the device. Therefore a thread of the plugin calls the
//! SDK, at up to 4 kHz, and the loop takes the newest sample:
//!
//! ```text
//! libdrd.so -> ffi -> Dhd -> Driver (thread) -> Exchange -> loop
//! ```
//!
//! - `ffi`: functions of the SDK, as the SDK declares them.
//! - `dhd`: safe calls in the axes of the contract; errors with text and remedy.
//! - `kind`: ranges and limits of the devices, by their type number.
//! - `driver`: the cycle of the thread.
//! - `plugin`: parameters and the contract.

mod dhd;
mod driver;
mod ffi;
mod kind;
mod plugin;

pub use plugin::{FLOTOR_ENTRY, ForceDimensionDevice};
