//! Torque-free tumbling against Jacobi's solution in elliptic functions, and against a geometric integrator.
//!
//! With angular momentum `L`, twice the energy `E2` and moments `I1 < I2 < I3` (here `L^2 > E2 I2`), started with
//! no spin about the middle axis, the spin in the body is
//!
//! ```text
//! w = (a1 cn(p t), a2 sn(p t), a3 dn(p t))
//! ```
//!
//! (Landau and Lifshitz, Mechanics, section 37). Two Euler angles follow from `L` as the body sees it; the third
//! turns about it at `L (I1 w1^2 + I2 w2^2) / (I1^2 w1^2 + I2^2 w2^2)`, a smooth function that Gauss-Legendre
//! quadrature integrates to rounding.

use super::{BARE, MILLISECOND_NS, NO_IMPEDANCE, advance, plant};
use crate::plant::{State, Wrench};
use flotor_hal::glam::{DQuat, DVec3};

const SPIN_RAD_PER_S: DVec3 = DVec3::new(3.0, 0.0, 7.0);

/// Sine, cosine and delta amplitude of argument `u` and parameter `m`, by the arithmetic-geometric mean
/// (Abramowitz and Stegun, 16.4).
fn jacobi(u: f64, m: f64) -> (f64, f64, f64) {
    let (mut a, mut b) = (1.0, (1.0 - m).sqrt());
    let mut ratios = Vec::new();
    let mut scale = 1.0;
    while (a - b) / a > 1.0e-16 && ratios.len() < 16 {
        let half_gap = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        ratios.push(half_gap / a);
        scale *= 2.0;
    }
    let amplitude =
        ratios.iter().rev().fold(scale * a * u, |phi, ratio: &f64| 0.5 * (phi + (ratio * phi.sin()).asin()));
    let (sn, cn) = amplitude.sin_cos();
    (sn, cn, (1.0 - m * sn * sn).sqrt())
}

/// The body started at rest orientation with [`SPIN_RAD_PER_S`].
struct Tumbling {
    inertia: DVec3,
    amplitude: DVec3,
    rate_per_s: f64,
    parameter: f64,
    momentum: f64,
}

impl Tumbling {
    fn new() -> Self {
        let inertia = BARE.inertia_kg_m2;
        let DVec3 { x: i1, y: i2, z: i3 } = inertia;
        let momentum = (inertia * SPIN_RAD_PER_S).length();
        let (l2, e2) = (momentum * momentum, (inertia * SPIN_RAD_PER_S).dot(SPIN_RAD_PER_S));
        assert!(i1 < i2 && i2 < i3 && l2 > e2 * i2, "the case the formulas are for");
        let (from_top, from_bottom) = (e2 * i3 - l2, l2 - e2 * i1);
        Self {
            inertia,
            amplitude: DVec3::new(
                (from_top / (i1 * (i3 - i1))).sqrt(),
                (from_top / (i2 * (i3 - i2))).sqrt(),
                (from_bottom / (i3 * (i3 - i1))).sqrt(),
            ),
            rate_per_s: (from_bottom * (i3 - i2) / (i1 * i2 * i3)).sqrt(),
            parameter: (i2 - i1) * from_top / ((i3 - i2) * from_bottom),
            momentum,
        }
    }

    fn spin(&self, t: f64) -> DVec3 {
        let (sn, cn, dn) = jacobi(self.rate_per_s * t, self.parameter);
        self.amplitude * DVec3::new(cn, sn, dn)
    }

    /// Rate of turning about the angular momentum, rad/s.
    fn precession(&self, t: f64) -> f64 {
        let momentum = self.inertia * self.spin(t);
        let spin = self.spin(t);
        let across = |v: DVec3, w: DVec3| v.x * w.x + v.y * w.y;
        self.momentum * across(momentum, spin) / across(momentum, momentum)
    }

    /// From the body to a frame whose third axis is the angular momentum, turned by `phi` about it.
    fn attitude(&self, t: f64, phi: f64) -> DQuat {
        let momentum = self.inertia * self.spin(t);
        let tilt = momentum.truncate().length().atan2(momentum.z);
        let psi = momentum.x.atan2(momentum.y);
        DQuat::from_rotation_z(phi) * DQuat::from_rotation_x(tilt) * DQuat::from_rotation_z(psi)
    }
}

/// Integral over 0..1 by four Gauss-Legendre nodes (Abramowitz and Stegun, table 25.4).
fn gauss(f: impl Fn(f64) -> f64) -> f64 {
    [(0.339_981_043_584_856_3, 0.652_145_154_862_546_1), (0.861_136_311_594_052_6, 0.347_854_845_137_453_9)]
        .iter()
        .map(|(node, weight)| 0.5 * weight * (f(0.5 - 0.5 * node) + f(0.5 + 0.5 * node)))
        .sum()
}

#[test]
fn elliptic_functions_meet_their_limits_and_a_table() {
    let (sn, cn, dn) = jacobi(0.7, 0.0);
    assert!((sn - 0.7_f64.sin()).abs() < 1.0e-15 && (cn - 0.7_f64.cos()).abs() < 1.0e-15 && dn == 1.0);
    // At the quarter period, K(1/2) = 1.854074677301372 (Abramowitz and Stegun, table 17.1).
    let (sn, cn, dn) = jacobi(1.854_074_677_301_372, 0.5);
    assert!((sn - 1.0).abs() < 1.0e-15 && cn.abs() < 1.0e-15 && (dn - 0.5_f64.sqrt()).abs() < 1.0e-15);
}

#[test]
fn tumbling_follows_jacobi_for_ten_seconds() {
    let exact = Tumbling::new();
    let start = State { angular_velocity_rad_per_s: SPIN_RAD_PER_S, ..State::HOME };
    let mut plant = plant(&BARE, &NO_IMPEDANCE, &start);
    let to_device = exact.attitude(0.0, 0.0).conjugate();
    let mut phi = 0.0;
    for tick in 0..10_000 {
        let t = f64::from(tick) * 1.0e-3;
        // A tick is a hundredth of the shortest period: four nodes reach rounding.
        phi += 1.0e-3 * gauss(|share| exact.precession(t + 1.0e-3 * share));
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
        let State { orientation, angular_velocity_rad_per_s, .. } = plant.state();
        let expected = to_device * exact.attitude(t + 1.0e-3, phi);
        let off_rad = 2.0 * (orientation.conjugate() * expected).xyz().length();
        // Rounding of ten thousand steps, and of phases up to 70 rad.
        assert!(off_rad <= 1.0e-11, "{off_rad:e} rad after {t} s");
        let spin = orientation.conjugate() * angular_velocity_rad_per_s;
        assert!((spin - exact.spin(t + 1.0e-3)).length() <= 1.0e-11 * 7.0, "after {t} s");
    }
}

/// Implicit midpoint rule for the momentum in the body, Cayley map for the attitude: second order, keeps energy
/// and momentum for ever (a geometric integrator; for instance Austin, Krishnaprasad and Wang 1993).
fn midpoint_step(orientation: DQuat, momentum: DVec3, h: f64) -> (DQuat, DVec3) {
    let mut next = momentum;
    for _ in 0..30 {
        let middle = 0.5 * (momentum + next);
        next = momentum + h * middle.cross(middle / BARE.inertia_kg_m2);
    }
    let half = 0.5 * h * (0.5 * (momentum + next) / BARE.inertia_kg_m2);
    ((orientation * DQuat::from_xyzw(half.x, half.y, half.z, 1.0)).normalize(), next)
}

#[test]
fn a_geometric_integrator_converges_to_the_same_motion() {
    let start = State { angular_velocity_rad_per_s: SPIN_RAD_PER_S, ..State::HOME };
    let mut plant = plant(&BARE, &NO_IMPEDANCE, &start);
    for _ in 0..1000 {
        advance(&mut plant, MILLISECOND_NS, &Wrench::ZERO, None);
    }
    let errors = [1000_u32, 2000, 4000].map(|steps| {
        let mut state = (DQuat::IDENTITY, BARE.inertia_kg_m2 * SPIN_RAD_PER_S);
        for _ in 0..steps {
            state = midpoint_step(state.0, state.1, 1.0 / f64::from(steps));
        }
        let kept = state.1.length() / (BARE.inertia_kg_m2 * SPIN_RAD_PER_S).length() - 1.0;
        assert!(kept.abs() < 1.0e-12, "rounding of {steps} steps: {kept:e}");
        2.0 * (state.0.conjugate() * plant.state().orientation).xyz().length()
    });
    for pair in errors.windows(2) {
        assert!(
            (pair[0] / pair[1] - 4.0).abs() < 0.01,
            "second order towards the plant's motion: {errors:?}"
        );
    }
}
