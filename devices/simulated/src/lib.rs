//! A simulated magnetic-levitation flotor, held by a simulated hand: everything runs without hardware.
//!
//! The plugin advances a [`Simulation`](simulation::Simulation) of flotor and hand by the scheduled length of each
//! tick: the wrench written in one tick acts, constant, until the next write (zero-order hold), as with real coils.
//!
//! Preset `plain` simulates flotor and hand alone. Preset `full` adds actuators and sensors: the wrench passes through
//! amplifiers, coils and an uneven field; the pose is computed from light spots on noisy position cells, quantised and
//! delayed; faults are injected on request.
//!
//! - [`plant`]: the flotor, a rigid body with six degrees of freedom.
//! - [`hand`]: impedance and intended motion of the hand.
//! - `fingers`: the grip between the fingers of the hand, if there is one.
//! - [`ledger`]: energy balance.
//! - [`workspace`]: range of motion and force limits.
//! - [`simulation`]: flotor, hand and energy balance on one clock.
//! - [`actuation`], [`sensing`], [`faults`]: the additions of preset `full`, connected by [`machine`].

pub mod actuation;
pub mod faults;
mod fingers;
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
mod units;
pub mod validation;
pub mod workspace;

pub use plugin::{FLOTOR_ENTRY, SimulatedFlotor};
