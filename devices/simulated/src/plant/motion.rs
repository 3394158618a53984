//! State of the integrator between steps: motion of the flotor.

use super::state::State;
use flotor_hal::glam::{DMat3, DQuat, DVec3};
use flotor_hal::restorable;

/// Largest physical magnitude: m, m/s and rad/s alike.
const PHYSICAL_LIMIT: f64 = 1.0e6;

/// Magnitude (m, m/s, rad/s or quaternion component) below which a number is set to zero: a decaying motion would otherwise
/// end in subnormal numbers, with which processors are many times slower.
const NEGLIGIBLE: f64 = 1.0e-100;

/// Pose and velocity, with the angular velocity in the flotor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    /// Position of the origin, device frame, m.
    pub(super) position_m: DVec3,
    /// Unit quaternion, flotor to device frame.
    pub(super) orientation: DQuat,
    /// Velocity of the origin, device frame, m/s.
    pub(super) velocity_m_per_s: DVec3,
    /// Angular velocity in the **flotor** frame, rad/s.
    pub(super) spin_rad_per_s: DVec3,
}

restorable!(Motion { position_m, orientation, velocity_m_per_s, spin_rad_per_s });

impl Motion {
    /// Converts a state and sets negligible numbers to zero: a straight step settles only the numbers it changes.
    /// Real-time: bounded, no allocation.
    pub(super) fn of(state: &State) -> Self {
        let orientation = state.orientation.normalize();
        Self {
            position_m: state.position_m,
            orientation,
            velocity_m_per_s: state.velocity_m_per_s,
            spin_rad_per_s: orientation.conjugate() * state.angular_velocity_rad_per_s,
        }
        .settled()
    }

    /// Returns the motion as a state, in the device frame. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn state(&self) -> State {
        State {
            position_m: self.position_m,
            orientation: self.orientation,
            velocity_m_per_s: self.velocity_m_per_s,
            angular_velocity_rad_per_s: self.turned(self.spin_rad_per_s),
        }
    }

    /// Rotates a vector from the flotor frame to the device frame. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn turned(&self, vector: DVec3) -> DVec3 {
        // Upright, the most frequent orientation, the product is the vector itself but for the sign of a zero.
        if self.orientation == DQuat::IDENTITY { vector } else { self.orientation * vector }
    }

    /// Returns the same pose without velocity. Real-time: bounded, no allocation.
    pub(super) fn at_rest(&self) -> Self {
        Self { velocity_m_per_s: DVec3::ZERO, spin_rad_per_s: DVec3::ZERO, ..*self }
    }

    /// Returns true within the physical limits; false for NaN. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn is_physical(&self) -> bool {
        self.moves_physically() && within(self.spin_rad_per_s) && self.orientation.is_finite()
    }

    /// Returns [`Self::is_physical`] of a motion without rotation. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn moves_physically(&self) -> bool {
        within(self.position_m) && within(self.velocity_m_per_s)
    }

    /// Returns the motion with negligible numbers set to zero. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn settled(&self) -> Self {
        let q = self.orientation;
        Self {
            orientation: DQuat::from_xyzw(settle(q.x), settle(q.y), settle(q.z), settle(q.w)),
            spin_rad_per_s: self.spin_rad_per_s.map(settle),
            ..self.moving_settled()
        }
    }

    /// Returns [`Self::settled`] of a motion without rotation. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn moving_settled(&self) -> Self {
        Self {
            position_m: self.position_m.map(settle),
            velocity_m_per_s: self.velocity_m_per_s.map(settle),
            ..*self
        }
    }
}

/// Returns true within the physical limit; false for NaN.
#[inline]
fn within(vector: DVec3) -> bool {
    vector.length_squared() <= PHYSICAL_LIMIT * PHYSICAL_LIMIT
}

#[inline]
fn settle(number: f64) -> f64 {
    if number.abs() < NEGLIGIBLE { 0.0 } else { number }
}

/// Position and velocity of the centre of mass relative to the origin, device frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swing {
    /// Rotation from flotor to device frame.
    pub(super) attitude: DMat3,
    /// Vector from the origin to the centre of mass, m.
    pub(super) arm: DVec3,
    /// Angular velocity, rad/s.
    pub(super) turning: DVec3,
    /// Velocity of the centre of mass minus that of the origin, m/s.
    pub(super) velocity: DVec3,
}

impl Swing {
    /// Computes the swing of a centre of mass (m) with an angular velocity (rad/s), both in the flotor frame. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub(super) fn new(orientation: DQuat, spin: DVec3, centre_of_mass: DVec3) -> Self {
        let attitude = DMat3::from_quat(orientation);
        let arm = attitude * centre_of_mass;
        let turning = attitude * spin;
        Self { attitude, arm, turning, velocity: turning.cross(arm) }
    }
}
