//! Angles measured by polynomials: smooth where the angle itself is not, and no inverse trigonometry.
//!
//! An elastic energy needs the square of an angle between two directions, or a twist, and their derivatives. An
//! arc cosine loses half its digits near zero and has a kink at half a turn. Both measures below are truncated
//! Taylor series in `1 - cos`, which a pose gives without cancellation as half the squared distance of two unit
//! vectors. Up to [`TRUSTED_VERSINE`] they are the angle to a relative 2e-5 (to rounding below 17 degrees);
//! beyond, up to half a turn and over it, they fall behind the angle but stay smooth, so that an energy built
//! on them is smooth on all rotations and its derivative is exactly the derivative of what is evaluated.
//!
//! Source: series of `asin² s` and `asin s / sqrt(1 - s²)` at `s = sin(angle / 2)`, NIST DLMF 4.24.

use crate::real::Real;

/// `1 - cos` of 60 degrees: beyond it the measures are a continuation.
pub const TRUSTED_VERSINE: f64 = 0.5;

const SQUARE_TERMS: usize = 6;
const TWIST_TERMS: usize = 8;

/// `angle² = sum of c^n 2^(n+1) / (n² binomial(2n, n))` for `n = 1, 2, ...`, at `c = 1 - cos`.
const SQUARE_SERIES: [f64; SQUARE_TERMS] = square_series();
/// `angle / sin = sum of c^n 2^n n!² / (2n+1)!` for `n = 0, 1, ...`.
const TWIST_SERIES: [f64; TWIST_TERMS] = twist_series();

#[allow(clippy::cast_precision_loss)] // integers below twenty
const fn square_series() -> [f64; SQUARE_TERMS] {
    let mut coefficients = [2.0; SQUARE_TERMS];
    let mut i = 1;
    while i < SQUARE_TERMS {
        let n = i as f64;
        coefficients[i] = coefficients[i - 1] * n * n / ((n + 1.0) * (2.0 * n + 1.0));
        i += 1;
    }
    coefficients
}

#[allow(clippy::cast_precision_loss)] // integers below twenty
const fn twist_series() -> [f64; TWIST_TERMS] {
    let mut coefficients = [1.0; TWIST_TERMS];
    let mut i = 1;
    while i < TWIST_TERMS {
        let n = i as f64;
        coefficients[i] = coefficients[i - 1] * n / (2.0 * n + 1.0);
        i += 1;
    }
    coefficients
}

/// A polynomial and its derivative.
#[inline(always)]
fn polynomial<R: Real, const N: usize>(coefficients: &[f64; N], x: R) -> (R, R) {
    let (mut value, mut slope) = (x.like(0.0), x.like(0.0));
    for coefficient in coefficients.iter().rev() {
        slope = slope * x + value;
        value = value * x + *coefficient;
    }
    (value, slope)
}

/// Square of the angle between two directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredAngle<R = f64> {
    /// `angle²` (rad²).
    pub value: R,
    /// Its derivative by `1 - cos angle`, two at zero.
    pub slope: R,
}

impl<R: Real> SquaredAngle<R> {
    /// From the versine `1 - cos angle`, 0 to 2. Real-time: bounded, no allocation, no branch.
    #[inline(always)]
    #[must_use]
    pub fn from_versine(versine: R) -> Self {
        let (quotient, quotient_slope) = polynomial(&SQUARE_SERIES, versine);
        Self { value: versine * quotient, slope: quotient + versine * quotient_slope }
    }
}

/// A signed angle of rotation about a known axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<R = f64> {
    /// The angle (rad); odd, and zero again at half a turn.
    pub value: R,
    /// Its derivative by the true angle, one at zero.
    pub slope: R,
}

impl<R: Real> Twist<R> {
    /// From sine and versine `1 - cos` of the angle. Real-time: bounded, no allocation, no branch.
    #[inline(always)]
    #[must_use]
    pub fn from_sine(sine: R, versine: R) -> Self {
        let (quotient, quotient_slope) = polynomial(&TWIST_SERIES, versine);
        let cosine = versine.like(1.0) - versine;
        Self { value: sine * quotient, slope: cosine * quotient + sine * sine * quotient_slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn versine(angle: f64) -> f64 {
        2.0 * (0.5 * angle).sin().powi(2)
    }

    #[test]
    fn measures_are_the_angle_where_trusted() {
        for (angle, tolerance) in [(0.0, 1e-15), (1e-9, 1e-15), (0.1, 1e-15), (0.3, 1e-11), (1.04, 2e-5)] {
            let squared = SquaredAngle::from_versine(versine(angle));
            assert!((squared.value - angle * angle).abs() <= tolerance * angle * angle, "{angle}");
            let twist = Twist::from_sine(angle.sin(), versine(angle));
            assert!((twist.value - angle).abs() <= tolerance * angle, "{angle}");
            assert_eq!(Twist::from_sine(-angle.sin(), versine(angle)).value, -twist.value);
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
            let squared = |c| SquaredAngle::from_versine(c);
            let c = versine(angle);
            let difference = (squared(c + h).value - squared(c - h).value) / (2.0 * h);
            assert!((difference - squared(c).slope).abs() < 1e-8, "square at {angle}");
            let twist = |w: f64| Twist::from_sine(w.sin(), versine(w));
            let difference = (twist(angle + h).value - twist(angle - h).value) / (2.0 * h);
            assert!((difference - twist(angle).slope).abs() < 1e-8, "twist at {angle}");
        }
    }
}
