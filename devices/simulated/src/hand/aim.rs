//! Intention of the hand at one instant ([`Aim`]) and during a piece of time ([`Intention`]), and the minimum-jerk
//! curve of voluntary movements.

use crate::validation::{Check, Domain, InvalidParameter, vector};
use flotor_hal::glam::{BVec3, DQuat, DVec3};
use flotor_hal::restorable;

/// Position and orientation in the device frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position of the flotor frame's origin, m.
    pub position_m: DVec3,
    /// Unit quaternion, flotor to device frame.
    pub orientation: DQuat,
}

restorable!(Pose { position_m, orientation });

impl Pose {
    /// Origin of the device frame, upright.
    pub const HOME: Self = Self { position_m: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Rounding tolerance of a unit quaternion's length in user input.
    const LENGTH_TOLERANCE: f64 = 1.0e-6;

    /// Rejects non-finite numbers and quaternions that are not a rotation. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not finite, or the quaternion has not unit length.
    pub(crate) fn check(&self) -> Check {
        vector("position_m", self.position_m, Domain::Finite)?;
        let length = self.orientation.length();
        // Written so that NaN is rejected too.
        if (length - 1.0).abs() <= Self::LENGTH_TOLERANCE {
            Ok(())
        } else {
            Err(InvalidParameter::NotARotation { name: "orientation", length })
        }
    }
}

/// Intention of the hand at one instant, device frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Aim {
    /// Intended pose of the handle.
    pub pose: Pose,
    /// Intended force on the handle, in addition to the force of spring and damper, N.
    pub force_n: DVec3,
    /// Axes with an intended force instead of a position: the hand has no stiffness there.
    pub yielding: BVec3,
}

restorable!(Aim { pose, force_n, yielding });

impl Aim {
    /// Creates an aim at a pose, without force. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub const fn at(pose: Pose) -> Self {
        Self { pose, force_n: DVec3::ZERO, yielding: BVec3::FALSE }
    }

    /// Creates an aim at a depth below home, m. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn below_home(depth_m: f64) -> Self {
        Self::at(Pose { position_m: DVec3::new(0.0, 0.0, -depth_m), orientation: DQuat::IDENTITY })
    }
}

/// Intention of the hand during a piece of time, device frame: position interpolated linearly, orientation and force constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intention {
    /// Intended position of the handle at the start, m.
    pub position_m: DVec3,
    /// Constant velocity of the intended position, m/s.
    pub velocity_m_per_s: DVec3,
    /// Constant intended orientation of the handle.
    pub orientation: DQuat,
    /// Intended angular velocity, used by the damping of the hand, rad/s.
    pub angular_velocity_rad_per_s: DVec3,
    /// Constant intended force on the handle, in addition to the force of spring and damper, N.
    pub force_n: DVec3,
    /// Axes with an intended force instead of a position: the hand has no stiffness there.
    pub yielding: BVec3,
}

impl Intention {
    /// Creates the intention to hold the handle at a pose. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn resting(pose: Pose) -> Self {
        Self {
            position_m: pose.position_m,
            velocity_m_per_s: DVec3::ZERO,
            orientation: pose.orientation,
            angular_velocity_rad_per_s: DVec3::ZERO,
            force_n: DVec3::ZERO,
            yielding: BVec3::FALSE,
        }
    }

    /// Returns the intention with the position extrapolated by `time_s` at constant velocity; all other fields are unchanged.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn later(&self, time_s: f64) -> Self {
        Self { position_m: self.position_m + self.velocity_m_per_s * time_s, ..*self }
    }
}

/// Returns the completed fraction (0 to 1) of a minimum-jerk movement `elapsed_s` after its start.
///
/// `10 u^3 - 15 u^4 + 6 u^5` with `u = elapsed / duration` (Flash and Hogan 1985); 0 before and 1 after.
/// Real-time: bounded, no allocation.
#[must_use]
#[inline]
pub fn minimum_jerk(elapsed_s: f64, duration_s: f64) -> f64 {
    let u = (elapsed_s / duration_s).clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (-15.0 + 6.0 * u))
}
