//! What differs between systems for a controller. Each system has one module with the same items:
//! - `reset_when_dropped`, `wait_for`, `descriptor`: connections;
//! - `access_remedy`: how a user is allowed to use a device on USB.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use unix as system;
#[cfg(windows)]
use windows as system;

#[cfg(any(feature = "usb", feature = "hid"))]
pub(crate) use system::access_remedy;
pub(crate) use system::{descriptor, reset_when_dropped, wait_for};
