//! Simplest device: a mass with a damper along each axis, an inertia with a damper about each, integrated exactly under
//! a constant wrench.

use flotor_hal::{DVec3, Pose, Twist, Wrench, orientation_from_rotation_vector};

/// Mass with a damper and an optional spring: one axis of the device with the hand on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Moving mass, kg.
    pub mass_kg: f64,
    /// Damping of the device and the hand, N s/m.
    pub damping_ns_per_m: f64,
    /// Stiffness of the hand, N/m.
    pub stiffness_n_per_m: f64,
}

impl Plant {
    /// Returns the discrete-time model for a zero-order hold of the force over a period. Rows: position, m, and
    /// velocity, m/s, at the end; columns: coefficients of initial position, m, initial velocity, m/s, and force, N.
    ///
    /// Exact: the state `(x, x', u)` obeys a linear equation with constant coefficients, whose exponential over a
    /// period contains both the free motion and the response to the force.
    #[must_use]
    pub fn held(&self, period_s: f64) -> [[f64; 3]; 2] {
        let [position, velocity, _] = exponential([
            [0.0, period_s, 0.0],
            [
                -self.stiffness_n_per_m / self.mass_kg * period_s,
                -self.damping_ns_per_m / self.mass_kg * period_s,
                period_s / self.mass_kg,
            ],
            [0.0; 3],
        ]);
        [position, velocity]
    }
}

type Matrix = [[f64; 3]; 3];

/// Returns the exponential of a small matrix by scaling and squaring of the Taylor series (Moler and Van Loan 2003,
/// method 3).
fn exponential(matrix: Matrix) -> Matrix {
    /// Limit of the scaled entries, 2^-4, at which 14 terms leave an error below 1e-16.
    const LARGEST_ENTRY: f64 = 0.0625;
    const TERMS: u32 = 14;
    let largest = matrix.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let mut halvings = 0;
    let mut scale = 1.0;
    while largest * scale > LARGEST_ENTRY && halvings < 64 {
        (halvings, scale) = (halvings + 1, 0.5 * scale);
    }
    let scaled = matrix.map(|row| row.map(|entry| entry * scale));
    let mut sum = IDENTITY;
    for term in (1..=TERMS).rev() {
        // Horner: I + A/1 (I + A/2 (I + ...)).
        sum = product(&scaled, &sum);
        for (row, unit) in sum.iter_mut().zip(IDENTITY) {
            for (entry, one) in row.iter_mut().zip(unit) {
                *entry = *entry / f64::from(term) + one;
            }
        }
    }
    (0..halvings).fold(sum, |root, _| product(&root, &root))
}

const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn product(left: &Matrix, right: &Matrix) -> Matrix {
    let [first, second, third] = right;
    left.map(|[a, b, c]| {
        let mut row = [0.0; 3];
        for (((entry, x), y), z) in row.iter_mut().zip(first).zip(second).zip(third) {
            *entry = a * x + b * y + c * z;
        }
        row
    })
}

/// Mass of the thesis's flotor, kg (Varadharajan 2007, section 3.2).
const MASS_KG: f64 = 0.58;
/// Moments of inertia of the simulated flotor (the real ones were never published), kg m².
const INERTIA_KG_M2: [f64; 3] = [3.35e-3, 3.35e-3, 3.65e-3];

/// Flotor in the model frame, with drag but without gravity, to isolate the effect of the loop.
pub struct Flotor {
    position_m: DVec3,
    velocity_m_per_s: DVec3,
    pose: Pose,
    angular_rad_per_s: DVec3,
    linear: Hold,
    angular: [Hold; 3],
}

/// Coefficients of one degree of freedom over one period of constant force.
#[derive(Clone, Copy)]
struct Hold([[f64; 3]; 2]);

impl Hold {
    /// Integrates `m v' + b v = F` over a period.
    fn new(mass_kg: f64, damping_ns_per_m: f64, period_s: f64) -> Self {
        Self(Plant { mass_kg, damping_ns_per_m, stiffness_n_per_m: 0.0 }.held(period_s))
    }

    /// Returns the final velocity and the displacement.
    fn advance(self, velocity: f64, force: f64) -> (f64, f64) {
        let [[_, coast_s, compliance], [_, decay, mobility]] = self.0;
        (velocity * decay + force * mobility, velocity * coast_s + force * compliance)
    }
}

impl Flotor {
    /// Creates a flotor at rest at `pose`. The rotational damping is the damping of the translation times the square of the lever
    /// arm `lever_m`.
    #[must_use]
    pub fn at_rest(pose: Pose, damping_ns_per_m: f64, lever_m: f64, period_s: f64) -> Self {
        let angular_damping = damping_ns_per_m * lever_m * lever_m;
        Self {
            position_m: pose.position(),
            velocity_m_per_s: DVec3::ZERO,
            pose,
            angular_rad_per_s: DVec3::ZERO,
            linear: Hold::new(MASS_KG, damping_ns_per_m, period_s),
            angular: INERTIA_KG_M2.map(|inertia| Hold::new(inertia, angular_damping, period_s)),
        }
    }

    /// Advances the flotor by one period under a constant wrench in the model frame.
    pub fn advance(&mut self, wrench: &Wrench) {
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

    /// Returns the pose at the end of the last period, in the model frame.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Returns the twist at the end of the last period, in the model frame.
    #[must_use]
    pub fn twist(&self) -> Twist {
        Twist::new(self.velocity_m_per_s, self.angular_rad_per_s)
    }

    /// Returns the kinetic energy, J.
    #[must_use]
    pub fn kinetic_j(&self) -> f64 {
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
