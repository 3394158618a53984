//! Shape of the bent linear beam-column, from which the end stiffnesses follow.
//!
//! Relative to the chord, the normals of the two end sections lean by `theta_L` and `theta_U`. Their half sum `S` bends
//! the rod to an S, their half difference `D` to a C. At `u = position along the chord / L - 1/2`, with the entire
//! functions of [`flotor_lanes::entire`], `s = 1 + P/beta'` and rigidities per current length (primed):
//!
//! ```text
//! theta = S (A C0(4 z u²) + B u² G0(z u²)²) + D 2 u G0(4 z u²) / G0(z)
//! y / L = S (s (A u G0(4 z u²) + B u³ h(z u²) / 3) - Q u)
//!       - D s (1/4 - u²) G0(z (1/2 + u)²) G0(z (1/2 - u)²) / G0(z)
//! ```
//!
//! The lean solves `theta'' = -4 z theta + 2 B S` and the offset from the chord `y' / L = s theta - Q S`: these
//! are equations 17 and 18 of the thesis, with the shear angle `Q` of the transverse force. `A`, `B` and `Q`
//! follow from `theta = S` and `y = 0` at both ends.

use crate::rigidity::Rigidities;
use flotor_lanes::Real;
use flotor_lanes::entire::EntireFunctions;
use flotor_lanes::saturation::{Saturated, saturate_above};

/// Argument `z` above which the argument is saturated, below the pole at 9.87, where the column buckles. At this argument
/// `G0 = 0.062`, and the bow stiffness is -16 times that of the unloaded rod.
pub const KNEE: f64 = 8.75;

/// Largest excess of the saturated `z` over [`KNEE`]: `z` stays below 9.25 (`G0 = 0.033`, bow stiffness -30 times that of the
/// unloaded rod).
pub const REACH: f64 = 0.5;

/// Saturates the argument short of the pole.
#[inline(always)]
pub(crate) fn saturated_argument<R: Real>(z: R) -> Saturated<R> {
    saturate_above(z, KNEE, REACH)
}

/// Returns the relative length at which the argument is `z`, the longer of two lengths; `None` if no length has this argument.
/// `load` is `gamma L0²/(4 alpha)`, `excess` is `1 - gamma/beta`.
pub(crate) fn relative_length(load: f64, excess: f64, z: f64) -> Option<f64> {
    // z = load p (1 - excess p) with p = 1 - L / L0, solved for the smaller p without cancellation.
    let discriminant = load * (load - 4.0 * excess * z);
    (discriminant >= 0.0).then(|| 1.0 - 2.0 * z / (load + discriminant.sqrt()))
}

/// Lean of a section from the chord, per radian of `S` or `D`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lean {
    pub(crate) value: f64,
    /// Derivative with respect to `u`.
    pub(crate) slope: f64,
}

/// Sway and bow shape of a rod at one length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    z: f64,
    g0: f64,
    softening: f64,
    /// `A`
    cosine: f64,
    /// `B`
    parabola: f64,
    /// `Q`
    shear: f64,
}

impl Shape {
    /// Returns the argument `z` of a length, `P s L² / (4 alpha')`; `None` without shear stiffness (`s <= 0`).
    pub(crate) fn argument(rigidities: &Rigidities, free_length_m: f64, length_m: f64) -> Option<f64> {
        let shortening_m = free_length_m - length_m;
        let sheared_m = length_m + rigidities.gamma_n / rigidities.beta_n * shortening_m;
        (sheared_m > 0.0)
            .then(|| rigidities.gamma_n * shortening_m * sheared_m / (4.0 * rigidities.alpha_n_m2))
    }

    /// Computes the shapes at an argument, which may be saturated: they are then the shapes of a rod with the corresponding
    /// bending rigidity, and still meet their end conditions. `None` without shear stiffness.
    pub(crate) fn new(rigidities: &Rigidities, free_length_m: f64, length_m: f64, z: f64) -> Option<Self> {
        let true_z = Self::argument(rigidities, free_length_m, length_m)?;
        // Rigidities per current length, and s = 1 + P / beta.
        let scale = length_m / free_length_m;
        let beta = rigidities.beta_n * scale;
        let alpha = rigidities.alpha_n_m2 * scale * if z == true_z { 1.0 } else { true_z / z };
        let softening = 1.0 + rigidities.gamma_n * (1.0 - scale) / beta;

        // The sway stiffness a + b, then Q, B and A from the end conditions theta = S and y = 0.
        let EntireFunctions { g0, g1, .. } = EntireFunctions::at(z);
        let sway = 0.5 * softening * length_m * g0
            / (g0 / beta + softening * length_m * length_m * g1 / (12.0 * alpha));
        let shear = 2.0 * sway / (length_m * beta);
        let parabola = softening * sway * length_m / alpha;
        let cosine = (shear / softening - parabola * EntireFunctions::at(0.25 * z).h() / 12.0) / g0;
        Some(Self { z, g0, softening, cosine, parabola, shear })
    }

    /// Returns the lean, per radian, of the section at `u` (-1/2 to 1/2 along the chord): of the sway (`S`) and of the bow (`D`).
    pub(crate) fn lean(&self, u: f64) -> [Lean; 2] {
        // `theta` of the module documentation and its derivative with respect to `u`.
        let square = u * u;
        let inner = EntireFunctions::at(self.z * square);
        let outer = EntireFunctions::at(4.0 * self.z * square);
        let sway = Lean {
            value: self.cosine * outer.c0 + self.parabola * square * (inner.g0 * inner.g0),
            slope: u * outer.g0 * (2.0 * self.parabola - 4.0 * self.z * self.cosine),
        };
        [sway, Lean { value: 2.0 * u * outer.g0 / self.g0, slope: 2.0 * outer.c0 / self.g0 }]
    }

    /// Returns the offset from the chord at `u`, in chord lengths per radian: of the sway and of the bow.
    pub(crate) fn offset(&self, u: f64) -> [f64; 2] {
        // `y / L` of the module documentation.
        let at = |position: f64| EntireFunctions::at(self.z * position * position);
        let (above, below) = (0.5 - u, 0.5 + u);
        let curved = self.cosine * at(2.0 * u).g0 + self.parabola * u * u * at(u).h() / 3.0;
        [
            u * (self.softening * curved - self.shear),
            -self.softening * (above * below) * (at(above).g0 * at(below).g0 / self.g0),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    /// Shapes of every preset, stretched to compressed close to buckling.
    fn shapes() -> impl Iterator<Item = Shape> {
        Preset::ALL.into_iter().flat_map(|preset| {
            let spring = preset.spring();
            [1.2, 1.0, 0.98, 0.95, 0.7].into_iter().filter_map(move |scale| {
                let free_length_m = spring.geometry().free_length_m;
                let length_m = scale * free_length_m;
                let z = Shape::argument(spring.rigidities(), free_length_m, length_m)?;
                if z < 9.0 { Shape::new(spring.rigidities(), free_length_m, length_m, z) } else { None }
            })
        })
    }

    #[test]
    fn shapes_meet_their_end_conditions() {
        assert!(shapes().count() > 15);
        for shape in shapes() {
            // Rounding, enlarged by the inverse of G0; in tension by G0 itself, the size of terms that cancel.
            let tolerance = 1e-14 * shape.g0.max(1.0 / shape.g0);
            for (u, bow_lean) in [(0.5, 1.0), (-0.5, -1.0)] {
                let [sway, bow] = shape.lean(u);
                assert!((sway.value - 1.0).abs() < tolerance && (bow.value - bow_lean).abs() < tolerance);
                assert!(shape.offset(u).iter().all(|offset| offset.abs() < tolerance));
            }
        }
    }

    #[test]
    fn shapes_satisfy_the_equations_of_the_column() {
        let h = 1e-3;
        for shape in shapes() {
            // Differences of second order: h² times a third derivative. Each two derivatives bring a factor
            // 4 z, and the coefficients bring the parabola's and the inverse of G0.
            let growth = 1.0 + shape.parabola + 16.0 * shape.z * shape.z;
            let tolerance = h * h * growth / shape.g0.min(1.0);
            for u in [-0.3, -0.1, 0.0, 0.25, 0.4] {
                for (i, load, shear) in [(0, 2.0 * shape.parabola, shape.shear), (1, 0.0, 0.0)] {
                    let slope = |f: &dyn Fn(f64) -> f64| (f(u + h) - f(u - h)) / (2.0 * h);
                    let lean = shape.lean(u)[i];
                    let offset_slope = slope(&|u| shape.offset(u)[i]);
                    assert!((offset_slope - (shape.softening * lean.value - shear)).abs() < tolerance);
                    assert!((slope(&|u| shape.lean(u)[i].value) - lean.slope).abs() < tolerance);
                    let bend = slope(&|u| shape.lean(u)[i].slope);
                    assert!((bend - (load - 4.0 * shape.z * lean.value)).abs() < tolerance);
                }
            }
        }
    }
}
