//! Platform-specific code. Each system has one module with the same items:
//! - `reset_when_dropped`, `wait_for`, `descriptor`: connections;
//! - `access_remedy`, `driver_remedy`: instructions for access to a USB device and for its driver;
//! - `hid_is_offered`: availability of HID in a loop.

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
#[cfg(feature = "usb")]
pub(crate) use system::driver_remedy;
#[cfg(feature = "hid")]
pub(crate) use system::hid_is_offered;
pub(crate) use system::{descriptor, reset_when_dropped, wait_for};
