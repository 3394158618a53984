//! Parts of a serial port that differ between systems. Each system has one module with the same items:
//! - `System`, `PATIENCE`: a port, and its timeout;
//! - `reason`: cause of an error of opening;
//! - `read`: non-blocking read;
//! - `descriptor`: descriptor of a port;
//! - `PORT_HELP`, `PORT_EXAMPLE`, `PORT_LIST`: user texts about a port's path.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, System, descriptor, read, reason};
#[cfg(windows)]
pub(crate) use windows::{PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, System, descriptor, read, reason};
