//! Wrench on the flotor, and its state.

use crate::hand::Pose;
use crate::validation::{Domain, InvalidParameter, vector};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::restorable;

/// Force and torque of the coils on the flotor, at the origin of the flotor frame, device frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force_n: DVec3,
    /// Torque about the origin of the flotor frame, N·m.
    pub torque_nm: DVec3,
}

restorable!(Wrench { force_n, torque_nm });

impl Wrench {
    /// Zero force and torque.
    pub const ZERO: Self = Self { force_n: DVec3::ZERO, torque_nm: DVec3::ZERO };

    /// Returns true if every number is finite. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.force_n.is_finite() && self.torque_nm.is_finite()
    }
}

/// Pose and velocity of the flotor, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Position of the flotor frame's origin, m.
    pub position_m: DVec3,
    /// Unit quaternion, flotor to device frame.
    pub orientation: DQuat,
    /// Velocity of the flotor frame's origin, m/s.
    pub velocity_m_per_s: DVec3,
    /// Angular velocity, rad/s.
    pub angular_velocity_rad_per_s: DVec3,
}

impl State {
    /// At rest at home.
    pub const HOME: Self = Self {
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        velocity_m_per_s: DVec3::ZERO,
        angular_velocity_rad_per_s: DVec3::ZERO,
    };

    /// Rejects non-finite states and orientations that are not a rotation. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a part is not finite or no rotation; the error contains its name.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        Pose { position_m: self.position_m, orientation: self.orientation }.check()?;
        vector("velocity_m_per_s", self.velocity_m_per_s, Domain::Finite)?;
        vector("angular_velocity_rad_per_s", self.angular_velocity_rad_per_s, Domain::Finite)
    }
}
