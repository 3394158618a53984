//! The controller's firmware as a state machine: the device's side between link and coils.
//!
//! The controller trusts no host. It accepts one session at a time, each command once and only while valid; limits force,
//! torque and their slew rates; keeps the flotor inside its own wall, and lands before the flotor leaves the sensors'
//! range. If no request arrives within the watchdog timeout while the flotor levitates, the controller holds, lands and
//! stays faulted until disarmed.
//!
//! ```text
//!            arm            take off              silence               held            down
//! Disarmed ------> Armed ------------> Levitating -------> Holding ----------> Landing ------> Fault
//!     ^               |                   |  |                                    |              |
//!     |    disarm     |      disarm       |  | land                               | (on request) | disarm
//!     +---------------+-------------------+  +----------> Landing ----------------+--> Disarmed  |
//!     +------------------------------------------------------------------------------------------+
//! ```
//!
//! A lost link disarms at once, from any mode. Without side effects: time and samples in, a wrench out; runs in the
//! emulator and could run on a microcontroller. Real-time: bounded, no allocation.

mod limits;
mod machine;

#[cfg(test)]
mod tests;

pub use limits::{LimitConfig, Load};
pub use machine::{Controller, ControllerConfig, Reply, Sample};
