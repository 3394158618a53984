//! 3Dconnexion's SpaceMouse and its relatives: six axes in, no force out.
//!
//! The puck springs back to where it was; how far it is pushed says how fast the pose moves. A tick takes all reports
//! that have come, remembers the newest deflection and moves the pose on:
//!
//! ```text
//! report bytes -> Report -> Deflection -> speed -> pose, inside its range
//! ```
//!
//! - [`report`]: the bytes of the puck, and nothing else.
//! - [`motion`]: from deflection to pose.
//! - [`source`]: where reports come from: hidapi, or a list in a test.
//! - `plugin`: parameters and the contract.

pub mod motion;
mod platform;
mod plugin;
pub mod report;
pub mod source;

pub use plugin::{FLOTOR_ENTRY, OpenPuck, SpaceMouse};
