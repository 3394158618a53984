//! What the integrator carries from step to step: the motion of the flotor and the pull of the hand.

use super::State;
use crate::hand::Intention;
use flotor_hal::glam::{DMat3, DQuat, DVec3};

/// Beyond these the numbers are no flotor's: m, m/s and rad/s alike.
const PHYSICAL_LIMIT: f64 = 1.0e6;

/// Below this a number (m, m/s, rad/s or quaternion component) is set to zero: a decaying motion would
/// otherwise end in subnormal numbers, with which a processor calculates many times slower.
const NEGLIGIBLE: f64 = 1.0e-100;

/// Pose and velocity, with the angular velocity in the frame the integrator needs it in.
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

impl Motion {
    /// From what the outside sees, settled: a straight step settles only what it changes. Real-time: bounded, no
    /// allocation.
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

    /// What the outside sees. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn state(&self) -> State {
        State {
            position_m: self.position_m,
            orientation: self.orientation,
            velocity_m_per_s: self.velocity_m_per_s,
            angular_velocity_rad_per_s: self.turned(self.spin_rad_per_s),
        }
    }

    /// A vector of the flotor frame in the device frame. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn turned(&self, vector: DVec3) -> DVec3 {
        // Upright, as most hands hold the flotor, the product would be the vector itself but for the sign of a zero.
        if self.orientation == DQuat::IDENTITY { vector } else { self.orientation * vector }
    }

    /// The same pose without velocity. Real-time: bounded, no allocation.
    pub(super) fn at_rest(&self) -> Self {
        Self { velocity_m_per_s: DVec3::ZERO, spin_rad_per_s: DVec3::ZERO, ..*self }
    }

    /// False for NaN as well. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn is_physical(&self) -> bool {
        self.moves_physically() && within(self.spin_rad_per_s) && self.orientation.is_finite()
    }

    /// [`Self::is_physical`] of a motion that does not turn. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn moves_physically(&self) -> bool {
        within(self.position_m) && within(self.velocity_m_per_s)
    }

    /// The same motion with what is negligible set to zero. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn settled(&self) -> Self {
        let q = self.orientation;
        Self {
            orientation: DQuat::from_xyzw(settle(q.x), settle(q.y), settle(q.z), settle(q.w)),
            spin_rad_per_s: self.spin_rad_per_s.map(settle),
            ..self.moving_settled()
        }
    }

    /// [`Self::settled`] of a motion that does not turn. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn moving_settled(&self) -> Self {
        Self {
            position_m: self.position_m.map(settle),
            velocity_m_per_s: self.velocity_m_per_s.map(settle),
            ..*self
        }
    }
}

/// False for NaN as well.
#[inline]
fn within(vector: DVec3) -> bool {
    vector.length_squared() <= PHYSICAL_LIMIT * PHYSICAL_LIMIT
}

#[inline]
fn settle(number: f64) -> f64 {
    if number.abs() < NEGLIGIBLE { 0.0 } else { number }
}

/// How the centre of mass lies from the origin and swings about it, device frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Swing {
    /// Flotor to device frame.
    pub(super) attitude: DMat3,
    /// From the origin to the centre of mass, m.
    pub(super) arm: DVec3,
    /// Angular velocity, rad/s.
    pub(super) turning: DVec3,
    /// Velocity of the centre of mass less that of the origin, m/s.
    pub(super) velocity: DVec3,
}

impl Swing {
    /// For a centre of mass (m) and an angular velocity (rad/s) in the flotor frame. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn new(orientation: DQuat, spin: DVec3, centre_of_mass: DVec3) -> Self {
        let attitude = DMat3::from_quat(orientation);
        let arm = attitude * centre_of_mass;
        let turning = attitude * spin;
        Self { attitude, arm, turning, velocity: turning.cross(arm) }
    }
}

/// The hand during a step: its intention at the start and the constant velocity it moves on with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Intended position at the start, m.
    pub(super) intended_m: DVec3,
    /// Its rate, m/s.
    pub(super) pace_m_per_s: DVec3,
    /// Intended orientation.
    pub(super) intended_orientation: DQuat,
    /// Its rate, device frame, rad/s.
    pub(super) turning_rad_per_s: DVec3,
    /// Intended force at the origin, device frame, N.
    pub(super) force_n: DVec3,
}

impl Contact {
    /// Stands in where no hand holds the flotor (the impedance is zero then).
    pub(super) const NONE: Self = Self {
        intended_m: DVec3::ZERO,
        pace_m_per_s: DVec3::ZERO,
        intended_orientation: DQuat::IDENTITY,
        turning_rad_per_s: DVec3::ZERO,
        force_n: DVec3::ZERO,
    };

    /// Of a hand with an intention. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn with(intention: &Intention) -> Self {
        Self {
            intended_m: intention.position_m,
            pace_m_per_s: intention.velocity_m_per_s,
            intended_orientation: intention.orientation,
            turning_rad_per_s: intention.angular_velocity_rad_per_s,
            force_n: intention.force_n,
        }
    }

    /// The same hand `time_s` later. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn later(&self, time_s: f64) -> Self {
        Self { intended_m: self.intended_m + self.pace_m_per_s * time_s, ..*self }
    }
}
