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
//! Stegun, 10.1), so that neighbours are tied by recurrences, `C0 = G0 - z G1 / 3`, `G0 = G1 - z G2 / 15`, and
//! derivatives are neighbours too, `dG0/dz = -G1 / 6`, `dG1/dz = -G2 / 10`.
//!
//! Evaluation: power series of `G1` and `G2` at `z / 16`, recurrences for the rest, then two angle doublings.

/// Terms of the power series: at `z / 16 = -3.75` the first one left out is below 1e-17 of the sum.
const TERMS: usize = 12;

/// `G1` and `G2` by powers of `-z`.
const G1_SERIES: [f64; TERMS] = power_series(1);
const G2_SERIES: [f64; TERMS] = power_series(2);

/// Coefficients of `Gn`: `(-1/2)^k (2n+1)!! / (k! (2n+2k+1)!!)`, by the quotient of neighbours.
#[allow(clippy::cast_precision_loss)] // integers below a hundred
const fn power_series(n: usize) -> [f64; TERMS] {
    let mut coefficients = [1.0; TERMS];
    let mut k = 1;
    while k < TERMS {
        coefficients[k] = -coefficients[k - 1] / ((2 * k) * (2 * n + 2 * k + 1)) as f64;
        k += 1;
    }
    coefficients
}

/// Sum of a series, even and odd powers apart: two short dependency chains instead of one long.
#[inline]
fn sum(coefficients: &[f64; TERMS], w: f64) -> f64 {
    let w2 = w * w;
    let (mut even, mut odd) = (0.0, 0.0);
    for pair in coefficients.as_chunks::<2>().0.iter().rev() {
        even = even * w2 + pair[0];
        odd = odd * w2 + pair[1];
    }
    even + w * odd
}

/// `C0`, `G0`, `G1`, `G2` at one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntireFunctions {
    /// `cos x`
    pub c0: f64,
    /// `sin x / x`
    pub g0: f64,
    /// `3 (sin x - x cos x) / x³`
    pub g1: f64,
    /// `15 ((3 - x²) sin x - 3 x cos x) / x⁵`
    pub g2: f64,
}

impl EntireFunctions {
    /// Smallest argument: deeper in tension use the quotients of
    /// [`StabilityFunctions`](crate::beam_column::StabilityFunctions), which do not grow.
    pub const MIN_ARGUMENT: f64 = -60.0;

    /// Largest argument: two and a half half-waves, past every pole a spring can reach.
    pub const MAX_ARGUMENT: f64 = 60.0;

    /// All four at `z`. Real-time: bounded, no allocation, no branch.
    ///
    /// Error below 5e-15 of the larger of 1 and the value for -60 <= z <= 9.5 (a half-wave is at 9.87), below
    /// 2e-14 up to 60. An argument outside -60..60 is moved to the nearer end and NaN to the lower one, so the
    /// result is always finite.
    #[inline]
    #[must_use]
    pub fn at(z: f64) -> Self {
        #[allow(clippy::manual_clamp)] // clamp would let NaN through
        let z = z.max(Self::MIN_ARGUMENT).min(Self::MAX_ARGUMENT);
        let w = z * 0.0625;
        let (g1, g2) = (sum(&G1_SERIES, w), sum(&G2_SERIES, w));
        let g0 = g1 - w * g2 * (1.0 / 15.0);
        let c0 = g0 - w * g1 * (1.0 / 3.0);
        Self { c0, g0, g1, g2 }.doubled(w).doubled(4.0 * w)
    }

    /// From `z` to `4 z`, that is from `x` to `2 x`.
    #[inline]
    fn doubled(self, z: f64) -> Self {
        let Self { c0, g0, g1, g2 } = self;
        Self {
            c0: 1.0 - 2.0 * z * (g0 * g0),
            g0: g0 * c0,
            g1: 0.25 * (c0 * g1 + 3.0 * (g0 * g0)),
            g2: 0.0625 * (c0 * g2 + 15.0 * (g0 * g1)),
        }
    }

    /// `h = 6 (1 - G0(4 z)) / (4 z) = 6 (2x - sin 2x) / (2x)³`, one at zero and free of the cancellation there.
    #[inline]
    #[must_use]
    pub fn h(&self) -> f64 {
        0.5 * (3.0 * self.g0 * self.g0 - self.c0 * self.g1)
    }
}

#[cfg(test)]
mod tests;
