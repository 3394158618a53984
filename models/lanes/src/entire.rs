//! Trigonometric quotients of a signed argument, without branches and without the math library.
//!
//! A compressed column bends in sines, a stretched one in hyperbolic sines, and a free one in polynomials. The
//! thesis writes three formulas and switches between them, dividing zero by zero where they meet. The quotients
//! below are *entire functions* of the signed `z = x²` (`x² > 0` compressed, `< 0` stretched): one power series
//! each, smooth through `z = 0`:
//!
//! | | compressed, `z = x²` | series |
//! |---|---|---|
//! | `C0` | `cos x` | `1 - z/2 + ...` |
//! | `G0` | `sin x / x` | `1 - z/6 + ...` |
//! | `G1` | `3 (sin x - x cos x) / x³` | `1 - z/10 + ...` |
//! | `G2` | `15 ((3 - x²) sin x - 3 x cos x) / x⁵` | `1 - z/14 + ...` |
//!
//! They are the spherical Bessel functions scaled to one at zero, `Gn = (2n+1)!! jn(x) / xⁿ` (Abramowitz and
//! Stegun, 10.1). Recurrences relate successive functions, `C0 = G0 - z G1 / 3`, `G0 = G1 - z G2 / 15`, and give the
//! derivatives, `dG0/dz = -G1 / 6`, `dG1/dz = -G2 / 10`.
//!
//! Evaluation: power series of `G1` and `G2` at `z / 16`, recurrences for `G0` and `C0`, then two angle doublings.

use crate::Real;

/// Number of terms of the power series: at `z / 16 = -3.75` the first omitted term is below 1e-17 of the sum.
const TERMS: usize = 12;

/// Coefficients of `G1` and `G2` by powers of `-z`.
const G1_SERIES: [f64; TERMS] = power_series(1);
const G2_SERIES: [f64; TERMS] = power_series(2);

/// Computes the coefficients of `Gn`, `(-1/2)^k (2n+1)!! / (k! (2n+2k+1)!!)`, from quotients of successive coefficients.
const fn power_series(n: usize) -> [f64; TERMS] {
    let mut coefficients = [1.0; TERMS];
    let mut k = 1;
    while k < TERMS {
        coefficients[k] = -coefficients[k - 1] / ((2 * k) * (2 * n + 2 * k + 1)) as f64;
        k += 1;
    }
    coefficients
}

/// Sums a series by Estrin's scheme, pairs of pairs: dependency chains a third as long as Horner's.
#[inline(always)]
fn sum<R: Real>(coefficients: &[f64; TERMS], w: R) -> R {
    let [c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11] = *coefficients;
    let w2 = w * w;
    let w4 = w2 * w2;
    let low = four(w, w2, [c0, c1, c2, c3]);
    let middle = four(w, w2, [c4, c5, c6, c7]);
    let high = four(w, w2, [c8, c9, c10, c11]);
    (high * w4 + middle) * w4 + low
}

#[inline(always)]
fn four<R: Real>(w: R, w2: R, [c0, c1, c2, c3]: [f64; 4]) -> R {
    (w * c3 + c2) * w2 + (w * c1 + c0)
}

/// Values of `C0`, `G0`, `G1`, `G2` at one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntireFunctions<R = f64> {
    /// `cos x`
    pub c0: R,
    /// `sin x / x`
    pub g0: R,
    /// `3 (sin x - x cos x) / x³`
    pub g1: R,
    /// `15 ((3 - x²) sin x - 3 x cos x) / x⁵`
    pub g2: R,
}

impl EntireFunctions {
    /// Smallest argument `z`. For stronger tension use the quotients of
    /// [`StabilityFunctions`](crate::stability::StabilityFunctions), which do not overflow.
    pub const MIN_ARGUMENT: f64 = -60.0;

    /// Largest argument `z`: almost two and a half half-waves, above every pole that a spring can reach.
    pub const MAX_ARGUMENT: f64 = 60.0;
}

impl<R: Real> EntireFunctions<R> {
    /// Evaluates all four functions at `z`. Real-time: bounded, no allocation, no branch.
    ///
    /// Error below 5e-15 of the larger of 1 and the value for -60 <= z <= 9.5 (a half-wave is at 9.87), below
    /// 2e-14 up to 60. An argument outside -60..60 is clamped, and NaN counts as -60, so the result is always finite.
    #[inline(always)]
    #[must_use]
    pub fn at(z: R) -> Self {
        let w = z.at_least(EntireFunctions::MIN_ARGUMENT).at_most(EntireFunctions::MAX_ARGUMENT) * 0.0625;
        let (g1, g2) = (sum(&G1_SERIES, w), sum(&G2_SERIES, w));
        // G0 and C0 by the recurrences, side by side.
        let (third, fifteenth) = (w * (1.0 / 3.0), w * (1.0 / 15.0));
        let next = fifteenth * g2;
        let (g0, c0) = (g1 - next, g1 - third * g1 - next);
        Self { c0, g0, g1, g2 }.doubled(w * 2.0).doubled(w * 8.0)
    }

    /// Doubles the argument from `x` to `2 x`, that is from `z` to `4 z`, given `2 z`.
    #[inline(always)]
    fn doubled(self, twice_z: R) -> Self {
        let Self { c0, g0, g1, g2 } = self;
        // Doubling of the angle: C0(4 z) = 1 - 2 z G0², G0(4 z) = G0 C0; G1 and G2 by the recurrences of the module.
        let square = g0 * g0;
        Self {
            c0: square.like(1.0) - square * twice_z,
            g0: g0 * c0,
            g1: (c0 * g1 + square * 3.0) * 0.25,
            g2: (c0 * g2 + g0 * g1 * 15.0) * 0.0625,
        }
    }

    /// Returns `h = 6 (1 - G0(4 z)) / (4 z) = 6 (2x - sin 2x) / (2x)³`, one at zero and free of cancellation there.
    #[inline(always)]
    #[must_use]
    pub fn h(&self) -> R {
        (self.g0 * self.g0 * 3.0 - self.c0 * self.g1) * 0.5
    }
}

#[cfg(test)]
mod tests;
