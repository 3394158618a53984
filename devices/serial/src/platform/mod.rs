//! What differs between systems for a serial port. Each system has one module with the same items:
//! - `System`, `PATIENCE`: a port, and how long it is waited for;
//! - `reason`: what an error of opening means;
//! - `read`: what has come;
//! - `descriptor`: the number of a port;
//! - `PORT_HELP`, `PORT_EXAMPLE`, `PORT_LIST`: what people are told of a port's path.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, System, descriptor, read, reason};
#[cfg(windows)]
pub(crate) use windows::{PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, System, descriptor, read, reason};
