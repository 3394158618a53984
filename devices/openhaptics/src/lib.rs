//! Device plugin for the Touch and Phantom family, over the OpenHaptics that the user has installed: no part of
//! OpenHaptics belongs to Flotor.
//!
//! The SDK sets the rate: its scheduler calls the plugin once a millisecond, and the loop takes the newest sample, without
//! delay if the scene has `pacing = "device"`:
//!
//! ```text
//! libHD.so -> ffi -> Hd -> callback of the scheduler -> Exchange -> loop
//! ```
//!
//! - `ffi`: functions of the SDK, as the SDK declares them.
//! - `hd`: safe calls in the axes and units of the contract; errors with text and remedy.
//! - `scheduler`: the scheduler, shared by all devices of a process, and its callback for each device.
//! - `plugin`: parameters and the contract.

mod ffi;
mod hd;
mod plugin;
mod scheduler;

pub use plugin::{FLOTOR_ENTRY, TouchDevice};
