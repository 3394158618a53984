//! A simulated magnetic-levitation flotor, held by a simulated hand: everything runs without hardware.
//!
//! The plugin steps a [`Simulation`](simulation::Simulation) of flotor and hand by the scheduled length of each
//! tick: the wrench written in one tick acts, constant, until the next (zero-order hold), as coils do.
//!
//! - [`plant`]: the flotor, a rigid body with six degrees of freedom.
//! - [`hand`]: what holds it, and what it means to do.
//! - [`ledger`]: where every joule came from and went.
//! - [`workspace`]: how far it moves and how hard it pushes.
//! - [`simulation`]: all of them on one clock.

pub mod hand;
pub mod ledger;
mod parameters;
pub mod plant;
mod plugin;
pub mod simulation;
pub mod validation;
pub mod workspace;

pub use plugin::{FLOTOR_ENTRY, SimulatedFlotor};
