//! Stability functions of a straight column under axial load: factors on its stiffness and flexibility without load.
//!
//! They are quotients of the entire functions of [`crate::entire`] in the signed argument `z` of the load: positive in
//! compression, negative in tension.

use flotor_hal::math;

use crate::Real;
use crate::entire::EntireFunctions;

/// Stability functions at one argument `z`, with `x = sqrt z`; all but the slope are 1 without load.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct StabilityFunctions<R = f64> {
    /// `C0 / G0 = x cot x`: bow stiffness relative to the unloaded rod.
    pub bow: R,
    /// `G1 / G0 = 3 (1 - x cot x) / x²`: bending part of the sway flexibility, relative to the unloaded rod.
    pub sway: R,
    /// `h / G0²`: writhe of a bow and a sway at right angles, relative to the unloaded rod.
    pub writhe: R,
    /// `d(sway)/dz`.
    pub sway_slope: R,
}

impl<R: Real> StabilityFunctions<R> {
    /// Evaluates the functions at `z`; poles at `z = pi², 4 pi², ...`. Real-time: bounded, no allocation.
    ///
    /// Accurate for every `z <= 60`, however negative; above, see [`EntireFunctions::at`].
    #[inline(always)]
    pub fn at(z: R) -> Self {
        let f = EntireFunctions::at(z);
        let inverse = f.g0.inverse();
        // Computes bow C0 / G0 and sway G1 / G0, and the derivative of sway with respect to z from dG0/dz = -G1 / 6 and dG1/dz = -G2 / 10.
        let (bow, sway) = (f.c0 * inverse, f.g1 * inverse);
        let sway_slope = sway * sway * (1.0 / 6.0) - f.g2 * inverse * 0.1;
        let regular = Self { bow, sway, writhe: writhe(bow, sway), sway_slope };
        let strong = z.below(EntireFunctions::MIN_ARGUMENT);
        if R::any(strong) { Self::in_strong_tension(z).or_where_not(strong, regular) } else { regular }
    }

    /// Returns `d(bow)/dz`.
    #[inline(always)]
    #[must_use]
    pub fn bow_slope(&self) -> R {
        self.writhe * (-1.0 / 3.0)
    }

    /// Returns `d(writhe)/dz`, from `writhe = (3 - bow sway) / 2`.
    #[inline(always)]
    #[must_use]
    pub fn writhe_slope(&self) -> R {
        (self.bow_slope() * self.sway + self.bow * self.sway_slope) * -0.5
    }

    /// Evaluates the functions at a large negative argument through `x coth x`, which does not overflow. Nothing
    /// cancels, as `x coth x` is far from one there.
    #[inline(always)]
    pub fn in_strong_tension(z: R) -> Self {
        // Lanes that are not in tension have no root; their results are discarded.
        let x = (-z).sqrt();
        let bow = x / x.map(math::tanh);
        let sway = (z.like(1.0) - bow) * 3.0 / z;
        let writhe = writhe(bow, sway);
        Self { bow, sway, writhe, sway_slope: (writhe - sway) / z }
    }

    #[inline(always)]
    fn or_where_not(self, mask: R::Mask, other: Self) -> Self {
        Self {
            bow: R::select(mask, self.bow, other.bow),
            sway: R::select(mask, self.sway, other.sway),
            writhe: R::select(mask, self.writhe, other.writhe),
            sway_slope: R::select(mask, self.sway_slope, other.sway_slope),
        }
    }
}

#[inline(always)]
fn writhe<R: Real>(bow: R, sway: R) -> R {
    (bow.like(3.0) - bow * sway) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let h = 1e-3;
        for step in -640..=90 {
            let z = 0.1 * f64::from(step) + 0.05;
            let slope = |pick: fn(StabilityFunctions) -> f64| {
                let f = |offset: f64| pick(StabilityFunctions::at(z + offset));
                (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
            };
            let exact = StabilityFunctions::at(z);
            // Truncation h⁴ f⁽⁵⁾ / 30 of the pole 2 pi² / (z - pi²), the worst part; rounding of f over h.
            let distance = (std::f64::consts::PI.powi(2) - z).abs();
            let truncation = h.powi(4) * 4.0 * 2.0 * 10.0 / distance.powi(6);
            let tolerance = 2.0 * truncation + 2e-14 / h * (1.0 + exact.bow.abs() + exact.sway.abs());
            assert!((slope(|s| s.bow) - exact.bow_slope()).abs() < tolerance, "bow at {z}");
            assert!((slope(|s| s.writhe) - exact.writhe_slope()).abs() < 10.0 * tolerance, "writhe at {z}");
            assert!((slope(|s| s.sway) - exact.sway_slope).abs() < tolerance, "sway at {z}");
        }
    }

    #[test]
    fn tension_is_continuous_where_the_evaluation_changes() {
        let z = EntireFunctions::MIN_ARGUMENT;
        let (near, far) = (StabilityFunctions::at(z), StabilityFunctions::in_strong_tension(z));
        for (a, b) in [
            (near.bow, far.bow),
            (near.sway, far.sway),
            (near.writhe, far.writhe),
            (near.sway_slope, far.sway_slope),
        ] {
            assert!((a - b).abs() < 1e-14 * b.abs().max(1.0), "{a} {b}");
        }
        let extreme = StabilityFunctions::at(-1e300);
        assert!(extreme.bow.is_finite() && extreme.sway.is_finite() && extreme.writhe.is_finite());
    }
}
