//! The simulated hand: a spring and a damper between the handle and its intended position.
//!
//! A person does not prescribe the position of the handle, but intends a motion, and the handle follows as far as the
//! object allows. The usual model (for instance van Beek et al. 2015) is an impedance
//!
//! ```text
//! F = F_intended + K (x_intended - x) + B (v_intended - v) - m a
//! ```
//!
//! per axis, and likewise in rotation. The hand grips at the origin of the flotor frame, and can release the handle. The
//! mass moves rigidly with the handle (the plant adds it to the flotor); the person carries the weight of the hand. A hand
//! that intends a force instead of a position has no stiffness along that force.
//!
//! - [`Impedance`]: K, B and m with published values.
//! - [`Trajectory`]: the intended motion, as a few numbers, a [`Script`] or a [`Recording`].
//! - [`Unsteadiness`]: tremor, and noise of the intended force.
//! - [`guidance`]: motion of the hand by a client of the run, in place of the trajectory.

mod aim;
pub mod guidance;
mod impedance;
mod recording;
mod script;
mod trajectory;
mod unsteadiness;

pub use aim::{Aim, Intention, Pose, minimum_jerk};
pub(crate) use guidance::{Follower, Guidance};
pub use impedance::{Grip, Impedance};
pub use recording::{Recording, RecordingError};
pub use script::{Script, ScriptError};
pub use trajectory::Trajectory;
pub use unsteadiness::Unsteadiness;

use crate::validation::InvalidParameter;
pub(crate) use unsteadiness::Wavering;

/// Simulated hand: impedance, intended motion and unsteadiness.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// Mechanical impedance at the handle.
    pub impedance: Impedance,
    /// Intended motion, and the times at which the hand holds the handle.
    pub trajectory: Trajectory,
    /// Tremor and noise of force.
    pub unsteadiness: Unsteadiness,
}

impl Hand {
    /// No hand: the flotor floats freely.
    pub const AWAY: Self = Self {
        impedance: Impedance::RELAXED,
        trajectory: Trajectory::Open,
        unsteadiness: Unsteadiness::NONE,
    };

    /// Hand of the demo: a firm grip that presses and releases 1.5 times a second.
    pub const EXPLORING: Self = Self {
        impedance: Impedance::FIRM,
        trajectory: Trajectory::EXPLORE,
        unsteadiness: Unsteadiness::NONE,
    };

    /// Checks all parameters. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a parameter is not finite, out of its range, or no rotation; the error contains its name.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        self.impedance.check()?;
        self.trajectory.check()?;
        self.unsteadiness.check()
    }
}
