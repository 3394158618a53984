//! Exact translation over a step in which the forces are constant or grow linearly.
//!
//! Per axis the handle obeys `x'' = a + j t - beta x' - kappa (x - x0)`: `beta` is drag plus hand damping over mass,
//! `kappa` the hand's stiffness over mass, `a + j t` the acceleration by coils, gravity and the moving intention. With
//! start velocity `v` its exact solution needs only the impulse response of the oscillator and its integrals,
//!
//! ```text
//! x - x0 = v p1 + a p2 + j p3,     x' = v p0 + a p1 + j p2,     p0 = p1',  p[n+1] = integral of p[n].
//! ```
//!
//! The usual formulas for `p1` (sine, exponential, hyperbolic sine) divide by a difference that vanishes at
//! critical damping and without stiffness. But the `p[n]` are entire functions of `beta`, `kappa` and time:
//! the Taylor series `p[n](t) = t^n sum c[k] / (n+k)!`, `c[k+1] = -beta t c[k] - kappa t^2 c[k-1]`, holds in
//! every damping regime, and for steps short against the oscillator (ensured by the plant) a few terms reach rounding. The
//! two highest are summed, the others follow from the equation of motion, `p[n] = t^n/n! - beta p[n+1] - kappa p[n+2]`,
//! without cancellation. This is the zero-order-hold discretisation of any textbook on sampled-data control, written for
//! small steps.

use flotor_hal::glam::DVec3;

/// Limit of rate times step for the series (pure number).
pub(super) const MAX_STEP_TIMES_RATE: f64 = 0.25;

/// Number of terms of the series. The first omitted term is below `0.41^14 / 18! * 4!`, 1e-20 of the sum: `0.41` is the
/// largest root of `c^2 = B c + K` at `B = 0.25`, `K = 0.0625`.
const TERMS: usize = 14;

/// Order of the highest response function.
const ORDER: usize = 4;

/// `1 / n!`, pure numbers.
const INVERSE_FACTORIAL: [f64; TERMS + ORDER] = inverse_factorials();

/// Three damped oscillators, one per axis of the device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Oscillator {
    /// Damping over mass, 1/s.
    pub(super) damping_per_s: DVec3,
    /// Stiffness over mass, 1/s².
    pub(super) stiffness_per_s2: DVec3,
}

/// Drive of the oscillators during a step: the coefficients `v`, `a`, `j` of the module's equations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drive {
    /// Velocity at the start, m/s.
    pub(super) velocity: DVec3,
    /// Acceleration at the start, without the damping of `velocity`, m/s².
    pub(super) acceleration: DVec3,
    /// Rate of the acceleration, m/s³.
    pub(super) jerk: DVec3,
}

/// The response functions `p0 ... p4` at one time after the start of a step (units s^n).
#[derive(Clone, Copy, Debug)]
pub(super) struct Response([DVec3; ORDER + 1]);

/// Integrals of products of response functions over a step: the exact integral of velocity squared as a
/// quadratic form in `v`, `a`, `j`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gramian {
    vv: DVec3,
    va: DVec3,
    vj: DVec3,
    aa: DVec3,
    aj: DVec3,
    jj: DVec3,
}

impl Oscillator {
    /// Returns the fastest rate of any axis, 1/s. Real-time: bounded, no allocation.
    pub(super) fn rate_per_s(&self) -> f64 {
        self.damping_per_s.max_element().max(self.stiffness_per_s2.max_element().sqrt())
    }

    /// Returns the response after `time_s`; `time_s` times [`Self::rate_per_s`] is at most [`MAX_STEP_TIMES_RATE`].
    ///
    /// Real-time: bounded, no allocation.
    pub(super) fn response(&self, time_s: f64) -> Response {
        let (beta, kappa) = (self.damping_per_s, self.stiffness_per_s2);
        // p3 and p4 by the Taylor series of the module documentation.
        let damping = beta * -time_s;
        let stiffness = kappa * -(time_s * time_s);
        let (mut previous, mut term) = (DVec3::ZERO, DVec3::ONE);
        let (mut sum3, mut sum4) = (DVec3::ZERO, DVec3::ZERO);
        for pair in INVERSE_FACTORIAL.windows(2).skip(3) {
            let &[of_p3, of_p4] = pair else { break };
            sum3 += term * of_p3;
            sum4 += term * of_p4;
            (previous, term) = (term, damping * term + stiffness * previous);
        }
        // The lower orders by p[n] = t^n / n! - beta p[n+1] - kappa p[n+2].
        let square = time_s * time_s;
        let p4 = sum4 * (square * square);
        let p3 = sum3 * (square * time_s);
        let p2 = 0.5 * square - beta * p3 - kappa * p4;
        let p1 = time_s - beta * p2 - kappa * p3;
        let p0 = 1.0 - beta * p1 - kappa * p2;
        Response([p0, p1, p2, p3, p4])
    }

    /// Returns the integrals over a step of `step_s`, under the condition of [`Self::response`]. Real-time: bounded, no
    /// allocation.
    ///
    /// Five Gauss-Legendre nodes integrate polynomials up to degree 9 exactly; the error for the products of response
    /// functions is below 1e-13 of the integral at the longest step allowed, and below rounding at a usual one.
    pub(super) fn gramian(&self, step_s: f64) -> Gramian {
        let mut sum = Gramian::default();
        for (node, weight) in GAUSS_LEGENDRE_5 {
            let Response([p0, p1, p2, ..]) = self.response(node * step_s);
            let weight = weight * step_s;
            sum.vv += p0 * p0 * weight;
            sum.va += p0 * p1 * weight;
            sum.vj += p0 * p2 * weight;
            sum.aa += p1 * p1 * weight;
            sum.aj += p1 * p2 * weight;
            sum.jj += p2 * p2 * weight;
        }
        sum
    }
}

impl Response {
    /// Returns the displacement since the start, m. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn displacement(&self, drive: &Drive) -> DVec3 {
        let Self([_, p1, p2, p3, _]) = self;
        drive.velocity * *p1 + drive.acceleration * *p2 + drive.jerk * *p3
    }

    /// Returns the velocity, m/s. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn velocity(&self, drive: &Drive) -> DVec3 {
        let Self([p0, p1, p2, ..]) = self;
        drive.velocity * *p0 + drive.acceleration * *p1 + drive.jerk * *p2
    }

    /// Returns the integral of the displacement since the start, m s. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn displacement_integral(&self, drive: &Drive) -> DVec3 {
        let Self([_, _, p2, p3, p4]) = self;
        drive.velocity * *p2 + drive.acceleration * *p3 + drive.jerk * *p4
    }

    /// Returns displacement (m) and velocity (m/s) for the given displacement and velocity at the start, without a
    /// drive. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn carry(
        &self,
        oscillator: &Oscillator,
        displacement: DVec3,
        velocity: DVec3,
    ) -> (DVec3, DVec3) {
        let Self([p0, p1, p2, ..]) = self;
        let kappa = oscillator.stiffness_per_s2;
        (
            displacement + (velocity * *p1 - kappa * *p2 * displacement),
            velocity * *p0 - kappa * *p1 * displacement,
        )
    }

    /// Returns displacement (m) and velocity (m/s) after a change of velocity at the start. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn after_kick(&self, velocity: DVec3) -> (DVec3, DVec3) {
        let Self([p0, p1, ..]) = self;
        (velocity * *p1, velocity * *p0)
    }
}

impl Gramian {
    /// Returns the integral of velocity squared over the step, per axis, m²/s. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn squared_velocity(&self, drive: &Drive) -> DVec3 {
        let Drive { velocity: v, acceleration: a, jerk: j } = *drive;
        // Quadratic form in velocity, acceleration and jerk with the Gramian of the response functions.
        v * (v * self.vv + 2.0 * (a * self.va + j * self.vj))
            + a * (a * self.aa + 2.0 * (j * self.aj))
            + j * j * self.jj
    }
}

/// Gauss-Legendre nodes and weights on 0..1 (Abramowitz and Stegun, table 25.4, moved from -1..1).
const GAUSS_LEGENDRE_5: [(f64, f64); 5] = [
    (0.046_910_077_030_668_004, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

const fn inverse_factorials() -> [f64; TERMS + ORDER] {
    let mut table = [1.0; TERMS + ORDER];
    let mut n = 1;
    let mut factorial = 1.0;
    while n < table.len() {
        factorial *= n as f64;
        table[n] = 1.0 / factorial;
        n += 1;
    }
    table
}

#[cfg(test)]
mod tests;
