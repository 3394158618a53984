//! Polynomial measures of angles: smooth where the angle itself is not, and without inverse trigonometry.
//!
//! An elastic energy needs the square of an angle between two directions, or a twist, and their derivatives. An arc
//! cosine loses half its digits near zero and has a kink at half a turn. Both measures below are truncated Taylor
//! series in `1 - cos`, which follows from a pose without cancellation as half the squared distance of two unit
//! vectors. Up to [`TRUSTED_VERSINE`] they equal the squared angle and the twist to a relative 2e-5 (to rounding below 17
//! degrees). For larger angles, also at half a turn, the measures are too small but smooth: an energy built on them is smooth
//! on all rotations, and its derivative is exact.
//!
//! Source: series of `asin² s` and `asin s / sqrt(1 - s²)` at `s = sin(angle / 2)`, NIST DLMF 4.24.

use crate::{Real, polynomial};

/// Largest versine `1 - cos` at which squared angle and twist are accurate (relative 2e-5): the versine of 60 degrees. For larger
/// versines both are smooth, but less than the exact values.
pub const TRUSTED_VERSINE: f64 = 0.5;

/// Coefficients of `angle² / c` by powers of `c = 1 - cos`: `2^(n+2) / ((n+1)² binomial(2n+2, n+1))`, `n = 0, 1, ...`.
const SQUARE_SERIES: [f64; 6] = series(2.0, true);
/// Coefficients of `angle / sin` by powers of `c`. Two more terms than in [`SQUARE_SERIES`] give the same accuracy.
const TWIST_SERIES: [f64; 8] = series(1.0, false);

/// Computes a series from the quotients of successive coefficients.
const fn series<const TERMS: usize>(first: f64, is_square: bool) -> [f64; TERMS] {
    let mut coefficients = [first; TERMS];
    let mut i = 1;
    while i < TERMS {
        let n = i as f64;
        let quotient = if is_square { n * n / (n + 1.0) } else { n };
        coefficients[i] = coefficients[i - 1] * quotient / (2.0 * n + 1.0);
        i += 1;
    }
    coefficients
}

/// Square of the angle between two directions, as a polynomial of the versine, with its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredAngle<R = f64> {
    /// Squared angle `angle²` (rad²).
    pub value: R,
    /// Derivative of `value` with respect to `1 - cos angle`; 2 at zero.
    pub slope: R,
}

/// Signed angle of rotation about a known axis, as a polynomial of the versine times the sine, with its derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<R = f64> {
    /// Angle (rad); odd, and zero again at half a turn.
    pub value: R,
    /// Derivative of `value` with respect to the true angle; 1 at zero.
    pub slope: R,
}

/// Returns the squares of three angles from their versines `1 - cos`, 0 to 2, and a twist from its versine and sine.
/// Real-time: bounded, no allocation, no branch.
#[inline(always)]
#[must_use]
pub fn measures<R: Real>(
    versines: [R; 3],
    twist_versine: R,
    twist_sine: R,
) -> ([SquaredAngle<R>; 3], Twist<R>) {
    let [a, b, c] = versines;
    let [quotient, slope] = polynomial(twist_versine, &TWIST_SERIES);
    let twist_slope =
        slope * (twist_sine * twist_sine) + quotient * (twist_versine.like(1.0) - twist_versine);
    // No closures here: the compiler would have to inline them before it may use wide registers.
    (
        [squared_angle(a), squared_angle(b), squared_angle(c)],
        Twist { value: quotient * twist_sine, slope: twist_slope },
    )
}

#[inline(always)]
fn squared_angle<R: Real>(versine: R) -> SquaredAngle<R> {
    let [quotient, slope] = polynomial(versine, &SQUARE_SERIES);
    SquaredAngle { value: quotient * versine, slope: slope * versine + quotient }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn versine(angle: f64) -> f64 {
        2.0 * (0.5 * angle).sin().powi(2)
    }

    /// Each of the three squares of the same versine, which must agree.
    fn square(versine: f64) -> SquaredAngle {
        let ([a, b, c], _) = measures([versine; 3], 0.3, 0.1);
        assert_eq!([a, b], [b, c]);
        a
    }

    fn twist(angle: f64) -> Twist {
        measures([0.0, 0.4, 1.1], versine(angle), angle.sin()).1
    }

    #[test]
    fn measures_are_the_angle_where_trusted() {
        for (angle, tolerance) in [(0.0, 1e-15), (1e-9, 1e-15), (0.1, 1e-15), (0.3, 1e-11), (1.04, 2e-5)] {
            let squared = square(versine(angle));
            assert!((squared.value - angle * angle).abs() <= tolerance * angle * angle, "{angle}");
            let there = twist(angle);
            assert!((there.value - angle).abs() <= tolerance * angle, "{angle}");
            assert_eq!(twist(-angle).value, -there.value);
        }
        assert_eq!(
            versine(std::f64::consts::FRAC_PI_3).max(TRUSTED_VERSINE),
            versine(std::f64::consts::FRAC_PI_3)
        );
    }

    #[test]
    fn slopes_are_derivatives_up_to_half_a_turn() {
        // Central differences: truncation h² f''' / 6 and rounding 1e-16 / h, f''' of order one hundred at most.
        let h = 1e-5;
        for step in 1..31 {
            let angle = 0.1 * f64::from(step);
            let c = versine(angle);
            let difference = (square(c + h).value - square(c - h).value) / (2.0 * h);
            assert!((difference - square(c).slope).abs() < 1e-8, "square at {angle}");
            let difference = (twist(angle + h).value - twist(angle - h).value) / (2.0 * h);
            assert!((difference - twist(angle).slope).abs() < 1e-8, "twist at {angle}");
        }
    }
}
