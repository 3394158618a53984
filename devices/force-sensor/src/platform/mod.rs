//! What differs between systems for a sensor at a serial port. Each system has one module with the same items:
//! - `Port`: a port;
//! - `PORT_HELP`, `PORT_EXAMPLE`, `ACCESS_QUESTION`: for people.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{ACCESS_QUESTION, PORT_EXAMPLE, PORT_HELP, Port};
#[cfg(windows)]
pub(crate) use windows::{ACCESS_QUESTION, PORT_EXAMPLE, PORT_HELP, Port};
