//! What differs between systems for a sensor at a serial port: what people are told. Each system has one module with the same items:
//! - `PORT_HELP`, `PORT_EXAMPLE`: where a port is;
//! - `ACCESS_QUESTION`: what to ask if it cannot be opened.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{ACCESS_QUESTION, PORT_EXAMPLE, PORT_HELP};
#[cfg(windows)]
pub(crate) use windows::{ACCESS_QUESTION, PORT_EXAMPLE, PORT_HELP};
