//! What the emulators of devices share.
//!
//! - [`command_line`]: numbers with limits, lines of output, a name for a terminal.
//! - [`port`]: a TCP port, and the users and machines whose programs may connect; [`clients`]: service to one at a time.
//! - [`rig`]: the rig of the vertical calibration: a stand that comes down step by step, and a force sensor.
//!
//! Not real-time.

pub mod clients;
pub mod command_line;
mod peer;
pub mod port;
pub mod rig;
