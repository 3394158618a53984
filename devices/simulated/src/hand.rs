//! The simulated hand: a spring and a damper between the handle and where the person means it to be.
//!
//! A person does not prescribe where the handle goes: they intend a motion, and the handle follows as far as
//! the object lets it. The usual model of that (for instance van Beek et al. 2015) is an impedance
//!
//! ```text
//! F = K (x_intended - x) + B (v_intended - v) - m a
//! ```
//!
//! per axis, and the same in rotation. [`Impedance`] holds K, B and m with published values, [`Trajectory`]
//! the intended motion. The hand grips at the origin of the flotor frame, and it can let go. The mass moves
//! rigidly with the handle (the plant adds it to the flotor); the person carries its weight.

mod impedance;
mod trajectory;

pub use impedance::Impedance;
pub use trajectory::{Intention, Pose, Trajectory, minimum_jerk};

use crate::validation::InvalidParameter;

/// A hand: how stiff it is and what it means to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Mechanical impedance at the handle.
    pub impedance: Impedance,
    /// Intended motion, and when the hand holds the handle.
    pub trajectory: Trajectory,
}

impl Hand {
    /// Nobody there: the flotor floats freely.
    pub const AWAY: Self = Self { impedance: Impedance::RELAXED, trajectory: Trajectory::Open };

    /// The demo: a firm hand that presses and releases 1.5 times a second.
    pub const EXPLORING: Self = Self { impedance: Impedance::FIRM, trajectory: Trajectory::EXPLORE };

    /// Refuses numbers that are not physical. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// Names the first parameter that is not finite, negative, or no rotation.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        self.impedance.check()?;
        self.trajectory.check()
    }
}
