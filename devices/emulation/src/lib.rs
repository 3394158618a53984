//! What the emulators of devices share.
//!
//! - [`command_line`]: numbers with limits, lines of output, a name for a terminal.
//! - [`port`]: a TCP port, and who is served there.
//! - [`rig`]: the rig of the vertical calibration: a stand that comes down step by step, and a force sensor.
//!
//! Not real-time.

pub mod command_line;
pub mod port;
pub mod rig;
