//! Plain data and maths of a run: what servo, recording and observers share, without any of them.
//!
//! - [`trace`]: what a tick leaves behind; [`demand`]: the outputs of models that a run needs.
//! - [`mapping`]: between the device frame and a model's frame.
//! - [`limits`]: limits of force and motion, the wall at the end of a device's range; [`rendered_boundary`]: the same wall on
//!   a device, in a loop; [`region`]: the vectors that limits allow.
//! - [`plausibility`]: whether a sample can be true.
//! - [`coupling`]: two devices held together; [`peer`]: what the two ends tell each other.
//! - [`guidance`]: the parameters that guide a simulated hand.
//! - [`Change`]: a parameter that changed while the loop ran.
//!
//! Nothing here reads files, starts threads or talks to the system.
#![forbid(unsafe_code)]

mod change;
mod clock;
pub mod coupling;
pub mod demand;
pub mod guidance;
pub mod limits;
pub mod mapping;
pub mod oscillation;
mod outputs;
pub mod peer;
pub mod plausibility;
mod random;
pub mod region;
pub mod rendered_boundary;
pub mod trace;

pub use change::{Change, ChangeOutcome, ChangeSubject};
pub use clock::Clock;
pub use outputs::ModelOutputs;
pub use random::Random;

/// Largest seed that commands and files take: every program reads the whole numbers up to it as they stand in JSON.
pub const LARGEST_SEED: u64 = 1 << 53;
/// Devices of a run at most.
pub const MOST_DEVICES: u16 = 8;
