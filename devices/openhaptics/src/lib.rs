//! The Touch and Phantom family, over the OpenHaptics that the user has installed: nothing of it is part of Flotor.
//!
//! The SDK owns the pace: its scheduler calls the plugin once a millisecond, and the loop takes the sample, at once if the scene
//! has `pacing = "device"`:
//!
//! ```text
//! libHD.so -> ffi -> Hd -> callback of the scheduler -> Exchange -> loop
//! ```
//!
//! - `ffi`: the functions that are used, as the SDK declares them.
//! - `hd`: the same, safe, in the axes and units of the contract; errors with their words.
//! - `scheduler`: the scheduler, which all devices of a process share, and the callback of each.
//! - `plugin`: parameters and the contract.

mod ffi;
mod hd;
mod plugin;
mod scheduler;

pub use plugin::{FLOTOR_ENTRY, TouchDevice};
