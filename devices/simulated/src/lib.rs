//! A simulated magnetic-levitation flotor, held by a simulated hand: everything runs without hardware.
//!
//! The plugin steps a [`Simulation`](simulation::Simulation) of flotor and hand by the scheduled length of each
//! tick: the wrench written in one tick acts, constant, until the next (zero-order hold), as coils do.
//!
//! Preset `plain` is that and no more. Preset `full` puts the machine between: the wrench goes through
//! amplifiers, coils and an uneven field, the pose comes from light spots on noisy cells, late and in steps, and
//! things break on request.
//!
//! - [`plant`]: the flotor, a rigid body with six degrees of freedom.
//! - [`hand`]: what holds it, and what it means to do.
//! - [`ledger`]: where every joule came from and went.
//! - [`workspace`]: how far it moves and how hard it pushes.
//! - [`simulation`]: all of them on one clock.
//! - [`actuation`], [`sensing`], [`faults`]: what preset `full` adds; [`machine`] puts them around the simulation.

pub mod actuation;
pub mod faults;
pub mod hand;
mod lag;
pub mod ledger;
mod linear;
pub mod machine;
mod noise;
mod parameters;
pub mod plant;
mod plugin;
mod sample_clock;
pub mod sensing;
pub mod simulation;
pub mod validation;
pub mod workspace;

pub use plugin::{FLOTOR_ENTRY, SimulatedFlotor};
