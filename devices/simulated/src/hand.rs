//! The simulated hand: a spring and a damper between the handle and where the person means it to be.
//!
//! A person does not prescribe where the handle goes: they intend a motion, and the handle follows as far as
//! the object lets it. The usual model of that (for instance van Beek et al. 2015) is an impedance
//!
//! ```text
//! F = F_intended + K (x_intended - x) + B (v_intended - v) - m a
//! ```
//!
//! per axis, and the same in rotation. The hand grips at the origin of the flotor frame, and it can let go. The
//! mass moves rigidly with the handle (the plant adds it to the flotor); the person carries its weight. A hand
//! that means a force rather than a place has no stiffness along that force.
//!
//! - [`Impedance`]: K, B and m with published values.
//! - [`Trajectory`]: what the hand aims at, as a few numbers, a [`Script`] or a [`Recording`].
//! - [`Unsteadiness`]: tremor, and forces that are never quite what was meant.
//! - [`guidance`]: a client of the run moves the hand in place of its trajectory.

pub mod guidance;
mod impedance;
mod recording;
mod script;
mod trajectory;
mod unsteadiness;

pub(crate) use guidance::{Follower, Guidance};
pub use impedance::{Grip, Impedance};
pub use recording::{Recording, RecordingError};
pub use script::{Script, ScriptError};
pub use trajectory::{Aim, Intention, Pose, Trajectory, minimum_jerk};
pub use unsteadiness::Unsteadiness;

use crate::validation::InvalidParameter;
pub(crate) use unsteadiness::Wavering;

/// A hand: how stiff it is, what it means to do, and how well it does.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    /// Mechanical impedance at the handle.
    pub impedance: Impedance,
    /// Intended motion, and when the hand holds the handle.
    pub trajectory: Trajectory,
    /// Tremor and noise of force.
    pub unsteadiness: Unsteadiness,
}

impl Hand {
    /// Nobody there: the flotor floats freely.
    pub const AWAY: Self = Self {
        impedance: Impedance::RELAXED,
        trajectory: Trajectory::Open,
        unsteadiness: Unsteadiness::NONE,
    };

    /// The demo: a firm hand that presses and releases 1.5 times a second.
    pub const EXPLORING: Self = Self {
        impedance: Impedance::FIRM,
        trajectory: Trajectory::EXPLORE,
        unsteadiness: Unsteadiness::NONE,
    };

    /// Refuses numbers that are not physical. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// Names the first parameter that is not finite, negative, or no rotation.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        self.impedance.check()?;
        self.trajectory.check()?;
        self.unsteadiness.check()
    }
}
