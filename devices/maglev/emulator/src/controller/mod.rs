//! The controller's firmware as a state machine: what stands between the link and the coils, on the device's side.
//!
//! The controller trusts nobody. It obeys one session at a time, each command once and only while it is valid;
//! limits force, torque and their change; keeps the flotor inside its own boundary, and lands before the sensors lose
//! one that leaves it all the same; and when the host falls silent it holds, sets the flotor down and stays faulted
//! until it is disarmed.
//!
//! ```text
//!            arm            take off              silence               held            down
//! Disarmed ------> Armed ------------> Levitating -------> Holding ----------> Landing ------> Fault
//!     ^               |                   |  |                                    |              |
//!     |    disarm     |      disarm       |  | land                               | (asked for)  | disarm
//!     +---------------+-------------------+  +----------> Landing ----------------+--> Disarmed  |
//!     +------------------------------------------------------------------------------------------+
//! ```
//!
//! A lost link disarms at once, from any mode. Pure: time and samples come in, a wrench comes out; the emulator
//! runs it, and so could a microcontroller. Real-time: bounded, no allocation.

mod limits;
mod machine;

#[cfg(test)]
mod tests;

pub use limits::{LimitConfig, Load};
pub use machine::{Controller, ControllerConfig, Reply, Sample};
