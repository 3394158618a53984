//! The linear beam-column: how an axially loaded rod resists rotation of its ends.
//!
//! Both ends of the rod are turned, by `psi_U` above and `psi_L` below, relative to the straight line between
//! them (the chord). The thesis writes `M_U = a psi_U + b psi_L` and `M_L = -(a psi_L + b psi_U)`. Two shapes
//! diagonalise this:
//! - **sway**, both ends turned alike: an S shape, stiffness `a + b`, in equilibrium with a transverse force;
//! - **bow**, ends turned against each other: a C shape, stiffness `a - b`, in pure bending.
//!
//! Axial compression softens both, to zero (the rod buckles in a C) and beyond. How far is told by the
//! *stability functions* of column theory, quotients of the entire functions of [`crate::entire`] in
//! `z = (q L)² / 4`, with the thesis's buckling factor `q` (equation 19).

use crate::entire::EntireFunctions;
use crate::rigidity::Rigidities;

/// Quotients of entire functions at one argument, with `x = sqrt z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StabilityFunctions {
    /// `C0 / G0 = x cot x`: bow stiffness relative to the unloaded rod.
    pub bow: f64,
    /// `G1 / G0 = 3 (1 - x cot x) / x²`: bending share of the sway flexibility, relative to the unloaded rod.
    pub sway: f64,
    /// `h / G0²`, the share of writhe in a bow and a sway at right angles.
    pub writhe: f64,
    /// `d(sway)/dz`.
    pub sway_slope: f64,
}

impl StabilityFunctions {
    /// At argument `z`; poles at `z = pi², 4 pi², ...`. Real-time: bounded, no allocation.
    ///
    /// Accurate for every `z <= 60`, however negative; above, see [`EntireFunctions::at`].
    #[inline]
    #[must_use]
    pub fn at(z: f64) -> Self {
        if z < EntireFunctions::MIN_ARGUMENT {
            return Self::in_strong_tension(z);
        }
        let f = EntireFunctions::at(z);
        let inverse = 1.0 / f.g0;
        let (bow, sway) = (f.c0 * inverse, f.g1 * inverse);
        let sway_slope = sway * sway * (1.0 / 6.0) - 0.1 * (f.g2 * inverse);
        Self { bow, sway, writhe: 0.5 * (3.0 - bow * sway), sway_slope }
    }

    /// `d(bow)/dz`.
    #[inline]
    #[must_use]
    pub fn bow_slope(&self) -> f64 {
        self.writhe * (-1.0 / 3.0)
    }

    /// `d(writhe)/dz`, from `writhe = (3 - bow sway) / 2`.
    #[inline]
    #[must_use]
    pub fn writhe_slope(&self) -> f64 {
        -0.5 * (self.bow_slope() * self.sway + self.bow * self.sway_slope)
    }

    /// The same by `x coth x`, which does not overflow where its parts would. The differences cancel nothing
    /// once `x coth x` is far from one.
    #[cold]
    fn in_strong_tension(z: f64) -> Self {
        let x = (-z).sqrt();
        let bow = x / x.tanh();
        let sway = 3.0 * (1.0 - bow) / z;
        let writhe = 0.5 * (3.0 - bow * sway);
        Self { bow, sway, writhe, sway_slope: (writhe - sway) / z }
    }
}

/// End stiffnesses of the printed law and of its correction, per chord length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStiffness {
    /// `a - b` (N·m/rad).
    pub bow_nm_per_rad: f64,
    /// `(a + b) / L` (N/rad): transverse force per sum of the end angles.
    pub sway_n_per_rad: f64,
    /// The argument `z = (q L)² / 4` they belong to; `pi²` is the first pole of the bow.
    pub argument: f64,
}

impl EndStiffness {
    /// The thesis's law (equations 19, 48, 49, 71, 72, 76 in one): rigidities per *unloaded* length, although
    /// the rod has become `length_m` long. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn printed(rigidities: &Rigidities, axial_force_n: f64, length_m: f64) -> Self {
        Self::of_column(rigidities.alpha_n_m2, rigidities.beta_n, axial_force_n, length_m)
    }

    /// The same with rigidities per *current* length: the coils that filled `L0` now fill `L`, so `alpha` and
    /// `beta` shrink by `L / L0` (Haringx). Exact linearisation of the exact rod. Real-time: bounded, no
    /// allocation.
    #[inline]
    #[must_use]
    pub fn current_length(
        rigidities: &Rigidities,
        axial_force_n: f64,
        length_m: f64,
        free_length_m: f64,
    ) -> Self {
        let scale = length_m / free_length_m;
        Self::of_column(rigidities.alpha_n_m2 * scale, rigidities.beta_n * scale, axial_force_n, length_m)
    }

    #[inline]
    fn of_column(alpha_n_m2: f64, beta_n: f64, axial_force_n: f64, length_m: f64) -> Self {
        let softening = 1.0 + axial_force_n / beta_n;
        let bending = softening * length_m * length_m / alpha_n_m2;
        let argument = 0.25 * axial_force_n * bending;
        let stability = StabilityFunctions::at(argument);
        Self {
            bow_nm_per_rad: 2.0 * alpha_n_m2 / length_m * stability.bow,
            sway_n_per_rad: 0.5 * softening / (1.0 / beta_n + bending * stability.sway / 12.0),
            argument,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

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

    #[test]
    fn unloaded_rod_has_the_textbook_stiffness() {
        let rigidities = *Preset::Thesis1.spring().rigidities();
        let length_m = 0.025;
        let rest = EndStiffness::printed(&rigidities, 0.0, length_m);
        let bow = 2.0 * rigidities.alpha_n_m2 / length_m;
        assert!((rest.bow_nm_per_rad - bow).abs() < 1e-15 * bow);
        // Timoshenko beam: equation 76.
        let sway = 0.5 * rigidities.beta_n
            / (1.0 + rigidities.beta_n * length_m * length_m / (12.0 * rigidities.alpha_n_m2));
        assert!((rest.sway_n_per_rad - sway).abs() < 1e-15 * sway);
    }

    #[test]
    fn haringx_buckling_is_a_pole_of_the_bow() {
        // Spring 3 buckles at 54.53663152247124 % compression (exact fixed-fixed condition).
        let spring = Preset::Thesis3.spring();
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let compression = 0.545_366_315_224_712_4;
        let length_m = free_length_m * (1.0 - compression);
        let load_n = rigidities.gamma_n * compression;
        let column = EndStiffness::current_length(rigidities, load_n, length_m, free_length_m);
        // Rounding of a dozen operations on a value near ten.
        assert!((column.argument - std::f64::consts::PI.powi(2)).abs() < 1e-13);
    }
}
