//! What differs between systems for a board at a serial port. Each system has one module with the same items:
//! - `Port`, `PATIENCE`, `descriptor`: a port, how long it is waited for, and its number for a host that outlives this one;
//! - `PORT_HELP`, `PORT_EXAMPLE`, `PORT_LIST`, `ACCESS_REMEDY`: for people.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{ACCESS_REMEDY, PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, Port, descriptor};
#[cfg(windows)]
pub(crate) use windows::{ACCESS_REMEDY, PATIENCE, PORT_EXAMPLE, PORT_HELP, PORT_LIST, Port, descriptor};
