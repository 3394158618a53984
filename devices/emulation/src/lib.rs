//! Shared parts of the device emulators.
//!
//! - [`command_line`]: arguments, numbers with limits, lines of output, symbolic links to terminals.
//! - [`port`]: a TCP port with limits on the users and machines that may connect; [`clients`]: queue of clients, served
//!   one at a time.
//! - [`rig`]: the rig of the vertical calibration: a stand that comes down step by step, and a force sensor.
//!
//! Not real-time.

pub mod clients;
pub mod command_line;
mod peer;
pub mod port;
pub mod rig;
