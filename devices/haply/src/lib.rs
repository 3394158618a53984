//! Device plugin for Haply's 2DIY, a planar pantograph, over the serial protocol that its maker published with the hAPI library.
//!
//! Two motors turn the inner arms of a five-bar linkage; the outer arms meet at the handle. The board receives torques and
//! replies with angles, one reply per request:
//!
//! ```text
//! angles -> Pantograph -> pose          wrench -> Pantograph -> torques
//! ```
//!
//! - [`protocol`]: requests and replies as bytes.
//! - [`pantograph`]: kinematics: from angles to the handle's position, from force to torques, and back.
//! - [`board`]: one request at a time over a serial port, and recovery from lost replies.
//! - [`emulator`]: a board without hardware, for tests and for `examples/emulated_board.rs`.
//! - `plugin`: parameters and the contract.

pub mod board;
pub mod emulator;
pub mod pantograph;
mod plugin;
pub mod protocol;

pub use plugin::{FLOTOR_ENTRY, HaplyDevice};
