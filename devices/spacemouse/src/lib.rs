//! Device plugin for 3Dconnexion's SpaceMouse and its relatives: six axes in, no force out.
//!
//! The puck springs back to its rest position; its deflection sets the velocity of the pose. A tick reads the pending
//! reports, stores the newest deflection and moves the pose:
//!
//! ```text
//! report bytes -> Report -> Deflection -> speed -> pose, inside its range
//! ```
//!
//! - [`report`]: parser of the puck's reports.
//! - [`motion`]: from deflection to pose.
//! - [`source`]: source of reports: hidapi, or a list in tests.

pub mod motion;
mod platform;
mod plugin;
pub mod report;
pub mod source;

pub use plugin::{FLOTOR_ENTRY, SpaceMouse};
