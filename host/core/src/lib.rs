//! Plain data and maths of a run, shared by servo, recording and observers and independent of them.
//!
//! - [`trace`]: record of a tick; [`demand`]: the outputs of models that a run needs.
//! - [`mapping`]: mapping between the device frame and a model's frame.
//! - [`limits`]: limits of force and motion, the wall at the end of a device's range; [`rendered_boundary`]: the same wall on
//!   a device, in a loop, and [`boundary_wall`] its force; [`end_wall`]: the wall at the bounds of a model; [`region`]: the vectors
//!   that limits allow.
//! - [`broad_phase`]: the models that can act at a position.
//! - [`asynchronous`]: timing of an asynchronous model, and the limits of its contacts.
//! - [`run_state`]: the states of a run, and the force that may pass in each.
//! - [`plausibility`]: checks of device samples; [`oscillation`]: detection of an unstable loop.
//! - [`grip`], [`grip_guard`]: the grip of a device, its check and limits; [`feel`]: stiffness and settling time that the hand
//!   felt; [`weight`]: the weight of a model that fades.
//! - [`coupling`]: virtual coupling of two devices; [`peer`]: messages between the two ends of a coupling.
//! - [`tally`]: statistics of the ticks of a run; [`health`]: problems of a model, counted and as text.
//! - [`guidance`]: the parameters that guide a simulated hand.
//! - [`parameter_change`]: a change of a parameter in the loop, and [`gradual`] its movement to the new value.
//! - [`Change`]: a change to a plugin while the loop ran; [`PluginIndex`]: number of a plugin in the run.
//! - [`fade()`]: smooth step of a force; [`civil_date()`]: date of a day.
//! - [`words`], [`sent`]: encoding of records that threads or processes share; [`lock()`]: locks of threads other than the loop.
//!
//! The crate reads no files, starts no threads and, apart from [`lock()`], makes no system calls.
#![forbid(unsafe_code)]

pub mod asynchronous;
pub mod boundary_wall;
pub mod broad_phase;
mod change;
mod clock;
pub mod coupling;
mod date;
pub mod demand;
pub mod end_wall;
mod fade;
pub mod feel;
pub mod gradual;
pub mod grip;
pub mod grip_guard;
pub mod guidance;
pub mod health;
pub mod limits;
mod lock;
pub mod mapping;
pub mod oscillation;
mod outputs;
pub mod parameter_change;
pub mod peer;
pub mod plausibility;
mod plugin_index;
mod quantile;
mod random;
pub mod region;
pub mod rendered_boundary;
pub mod run_state;
pub mod sent;
pub mod tally;
pub mod trace;
pub mod weight;
pub mod words;

pub use change::{Change, ChangeOutcome, ChangeSubject};
pub use clock::{Clock, period_ns, to_ns};
pub use date::civil_date;
pub use fade::fade;
pub use lock::lock;
pub use outputs::ModelOutputs;
pub use plugin_index::PluginIndex;
pub use quantile::quantile;
pub use random::Random;

/// Largest seed that commands and files accept: every program reads whole numbers up to this limit exactly from JSON.
pub const LARGEST_SEED: u64 = 1 << 53;
/// Largest number of devices in a run.
pub const MAX_DEVICES: u16 = 8;

#[cfg(test)]
#[path = "../../../tests/src/random.rs"]
mod test_random;
