//! Haply's 2DIY, a planar pantograph, over the serial protocol its maker published with the hAPI library.
//!
//! Two motors turn the inner arms of a five-bar linkage; the handle is where the outer arms meet. The board takes
//! torques and answers with angles, one answer for one request:
//!
//! ```text
//! angles -> Pantograph -> pose          wrench -> Pantograph -> torques
//! ```
//!
//! - [`protocol`]: requests and answers as bytes.
//! - [`pantograph`]: from angles to the handle, from force to torques, and back.
//! - [`board`]: one request at a time over a link of bytes, and what to do when an answer is lost.
//! - [`emulator`]: a board without hardware, for tests and for `examples/emulated_board.rs`.
//! - `plugin`: parameters and the contract.

pub mod board;
pub mod emulator;
pub mod pantograph;
mod plugin;
pub mod protocol;

pub use plugin::{FLOTOR_ENTRY, HaplyDevice};
