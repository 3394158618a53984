//! A measured spring: the force-length curve of a real one, served as it was measured.
//!
//! CMU-RI-TR-07-21 (section 7) proposes to compare the virtual spring with real ones. A fitted spring has the real one's
//! stiffness; this model has its whole curve, with ends that do not lie flat yet and coils that begin to touch.
//!
//! ```text
//! table (compression_mm, force_n) -> [`table`] -> [`curve`] -> F_z = s F(x),  x = -z,  E = s ∫ F dx
//! ```
//!
//! A table of lengths and forces knows one direction: there is no torque and no force sideways, and above its free length the
//! spring lies loose. `stiffness_scale` s makes it stiffer or softer as a whole, so that it can be the base of an experiment.

pub mod curve;
mod plugin;
pub mod table;

pub use plugin::Measured;
