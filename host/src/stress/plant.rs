//! The plainest device there is: a mass on a damper along each axis, an inertia on a damper about each,
//! solved exactly while a wrench is held. In the model frame, without gravity: what is left is the loop
//! alone.

use super::LEVER_M;
use flotor_hal::{DVec3, Pose, Twist, Wrench, math, orientation_from_rotation_vector};

/// The thesis's flotor, kg (Varadharajan 2007, section 3.2).
const MASS_KG: f64 = 0.58;
/// Its moments of inertia as the simulated flotor has them (never published), kg m².
const INERTIA_KG_M2: [f64; 3] = [3.35e-3, 3.35e-3, 3.65e-3];

/// State and exact step of the device.
pub(super) struct Plant {
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    pose: Pose,
    angular_rad_per_s: DVec3,
    linear: Hold,
    angular: [Hold; 3],
}

/// One degree of freedom over one period of constant force.
#[derive(Clone, Copy)]
struct Hold {
    /// What is left of a velocity.
    decay: f64,
    /// Velocity per force.
    mobility: f64,
    /// Way per velocity at the start, s.
    coast_s: f64,
    /// Way per force.
    compliance: f64,
}

impl Hold {
    /// `m v' + b v = F`, solved over `period_s`.
    fn new(inertia: f64, damping: f64, period_s: f64) -> Self {
        let rate = damping / inertia;
        let lost = -math::exp_m1(-rate * period_s);
        let coast_s = lost / rate;
        Self {
            decay: 1.0 - lost,
            mobility: lost / damping,
            coast_s,
            compliance: (period_s - coast_s) / damping,
        }
    }

    fn advance(self, velocity: f64, force: f64) -> (f64, f64) {
        (velocity * self.decay + force * self.mobility, velocity * self.coast_s + force * self.compliance)
    }
}

impl Plant {
    /// At rest at a pose. Drag on rotation is the drag on translation at the lever arm.
    pub(super) fn at_rest(pose: Pose, damping_ns_per_m: f64, period_s: f64) -> Self {
        let angular_damping = damping_ns_per_m * LEVER_M * LEVER_M;
        Self {
            position_m: pose.position(),
            velocity_m_per_s: DVec3::ZERO,
            pose,
            angular_rad_per_s: DVec3::ZERO,
            linear: Hold::new(MASS_KG, damping_ns_per_m, period_s),
            angular: INERTIA_KG_M2.map(|inertia| Hold::new(inertia, angular_damping, period_s)),
        }
    }

    /// One period under a held wrench.
    pub(super) fn advance(&mut self, wrench: &Wrench) {
        let mut shift_m = [0.0; 3];
        let mut turn_rad = [0.0; 3];
        let (force_n, torque_nm) = (wrench.force_n, wrench.torque_nm);
        let mut velocity = self.velocity_m_per_s.to_array();
        let mut angular = self.angular_rad_per_s.to_array();
        for axis in 0..3 {
            (velocity[axis], shift_m[axis]) = self.linear.advance(velocity[axis], force_n[axis]);
            (angular[axis], turn_rad[axis]) = self.angular[axis].advance(angular[axis], torque_nm[axis]);
        }
        self.velocity_m_per_s = DVec3::from_array(velocity);
        self.angular_rad_per_s = DVec3::from_array(angular);
        self.position_m += DVec3::from_array(shift_m);
        let turn = orientation_from_rotation_vector(DVec3::from_array(turn_rad));
        self.pose = Pose::new(self.position_m, (turn * self.pose.orientation()).normalize());
    }

    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    pub(super) fn twist(&self) -> Twist {
        Twist::new(self.velocity_m_per_s, self.angular_rad_per_s)
    }

    /// Energy of motion, J.
    pub(super) fn kinetic_j(&self) -> f64 {
        let spin = self.angular_rad_per_s * self.angular_rad_per_s;
        0.5 * (MASS_KG * self.velocity_m_per_s.length_squared() + spin.dot(DVec3::from_array(INERTIA_KG_M2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hold_is_the_closed_form() {
        let (m, b, t, f, v0) = (0.58, 2.0, 0.25, 3.0, -0.4);
        let (v, x) = Hold::new(m, b, t).advance(v0, f);
        let gone = (-b * t / m).exp();
        assert!((v - (f / b + (v0 - f / b) * gone)).abs() < 1.0e-15);
        assert!((x - (f / b * t + (v0 - f / b) * m / b * (1.0 - gone))).abs() < 1.0e-15);
        // And two half periods are one whole.
        let half = Hold::new(m, b, 0.5 * t);
        let (v1, x1) = half.advance(v0, f);
        let (v2, x2) = half.advance(v1, f);
        assert!((v2 - v).abs() < 1.0e-15 && (x1 + x2 - x).abs() < 1.0e-15);
    }
}
