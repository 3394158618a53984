//! Force Dimension's devices, over the SDK that the user has installed: nothing of it is part of Flotor.
//!
//! The SDK's calls that set a force wait for the exchange with the device, so that a thread of the plugin follows them, at up to
//! 4 kHz, and the loop takes the newest sample:
//!
//! ```text
//! libdrd.so -> ffi -> Dhd -> Driver (thread) -> Exchange -> loop
//! ```
//!
//! - `ffi`: the functions that are used, as the SDK declares them.
//! - `dhd`: the same, safe, in the axes of the contract; errors with their words.
//! - `kind`: what the devices can do, by their number.
//! - `driver`: the cycle of the thread.
//! - `plugin`: parameters and the contract.

mod dhd;
mod driver;
mod ffi;
mod kind;
mod plugin;

pub use plugin::{FLOTOR_ENTRY, ForceDimensionDevice};
