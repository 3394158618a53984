//! What differs between systems for a board at a serial port: what people are told. Each system has one module with the same items:
//! - `PORT_HELP`, `PORT_EXAMPLE`, `PORT_LIST`: where a port is.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{PORT_EXAMPLE, PORT_HELP, PORT_LIST};
#[cfg(windows)]
pub(crate) use windows::{PORT_EXAMPLE, PORT_HELP, PORT_LIST};
