//! Measured spring: force-length curve of a real spring, served as measured.
//!
//! CMU-RI-TR-07-21 (section 7) proposes to compare the virtual spring with real springs. A fitted spring has only the
//! stiffness of the real spring; this model has the whole curve, with ends that are not yet seated and coils that begin to touch.
//!
//! ```text
//! table (compression_mm, force_n) -> [`table`] -> [`curve`] -> F_z = s F(x),  x = -z,  E = s ∫ F dx
//! ```
//!
//! A table of compressions and forces covers one direction: there is no torque and no sideways force, and above its free
//! length the spring has no force. `stiffness_scale` s scales the whole force, as a parameter for experiments.

pub mod curve;
mod plugin;
pub mod table;

pub use plugin::{FLOTOR_ENTRY, Measured};
