//! Linear beam-column: resistance of an axially loaded rod to rotation of its ends.
//!
//! Both ends of the rod are turned, by `psi_U` above and `psi_L` below, relative to the straight line between
//! them (the chord). The thesis writes `M_U = a psi_U + b psi_L` and `M_L = -(a psi_L + b psi_U)`. Two shapes
//! diagonalise these equations:
//! - **sway**, both ends turned alike: an S shape, stiffness `a + b`, in equilibrium with a transverse force;
//! - **bow**, ends turned against each other: a C shape, stiffness `a - b`, in pure bending.
//!
//! Axial compression reduces both stiffnesses, to zero (the rod buckles in a C) and below, as given by the *stability functions*
//! of column theory ([`flotor_lanes::stability`]), quotients of the entire functions of [`flotor_lanes::entire`] in
//! `z = (q L)² / 4`, with the thesis's buckling factor `q` (equation 19).

use crate::rigidity::Rigidities;
use flotor_lanes::Real;
use flotor_lanes::entire::EntireFunctions;
use flotor_lanes::saturation::saturate_above;
use flotor_lanes::stability::StabilityFunctions;

/// Argument above which a law of the linear column is not trusted, rounded down: there `G0` is 0.3, and the torque has an
/// error of 3 to 5 % (spring 3).
pub const TRUSTED_ARGUMENT: f64 = 5.552;

/// Largest excess of the saturated argument of a closed form: `G0` stays above 0.175 and the bow stiffness above -5.1 times that
/// of the unloaded rod, short of the pole at 9.87.
const REACH: f64 = 1.5;

/// Prepared constants of the closed form's rod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// `2 alpha`
    bow_n_m2: f64,
    /// `1 / (4 alpha)`
    load_per_n_m2: f64,
    /// `1 / (12 alpha)`
    bending_per_n_m2: f64,
    /// `1 / beta`
    shear_per_n: f64,
}

impl Column {
    /// Prepares the constants. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(rigidities: &Rigidities) -> Self {
        Self {
            bow_n_m2: 2.0 * rigidities.alpha_n_m2,
            load_per_n_m2: 1.0 / (4.0 * rigidities.alpha_n_m2),
            bending_per_n_m2: 1.0 / (12.0 * rigidities.alpha_n_m2),
            shear_per_n: 1.0 / rigidities.beta_n,
        }
    }

    /// Returns the end stiffnesses under an axial force, at a length. Real-time: bounded, no allocation.
    ///
    /// `reference_m` is the length to which `alpha` and `beta` refer:
    /// - the current length itself gives the thesis's law (equations 19, 48, 49, 71, 72, 76 in one), which takes
    ///   the rigidities of the unloaded rod although the rod has become `length_m` long;
    /// - the free length gives the law per *current* length: the coils that filled `L0` now fill `L`, so `alpha`
    ///   and `beta` shrink by `L / L0` (Haringx). It is the exact linearisation of the exact rod.
    ///
    /// With `l` for `reference_m` and `Lam = L + l P / beta`:
    ///
    /// ```text
    /// z = P Lam l / (4 alpha)      a - b = (2 alpha / l) C0 / G0
    /// (a + b) / L = Lam / (2 l) G0 / (G0 / beta + Lam L G1 / (12 alpha))
    /// ```
    #[inline(always)]
    pub fn ends<R: Real>(&self, axial_force_n: R, length_m: R, reference_m: R) -> EndStiffness<R> {
        self.ends_with(axial_force_n, length_m, reference_m, |argument| argument)
    }

    /// Returns the end stiffnesses with the argument saturated short of the pole, from [`TRUSTED_ARGUMENT`] on: bounded
    /// wherever `Lam` is positive. Real-time: bounded, no allocation.
    #[inline(always)]
    pub fn bounded_ends<R: Real>(&self, axial_force_n: R, length_m: R, reference_m: R) -> EndStiffness<R> {
        let short_of_pole = |argument| saturate_above(argument, TRUSTED_ARGUMENT, REACH).value;
        self.ends_with(axial_force_n, length_m, reference_m, short_of_pole)
    }

    #[inline(always)]
    fn ends_with<R: Real>(
        &self,
        axial_force_n: R,
        length_m: R,
        reference_m: R,
        used: impl Fn(R) -> R,
    ) -> EndStiffness<R> {
        // `l P`, `Lam`, `z` of the formulas above, and the two parts of the denominator of `(a + b) / L`.
        let load_nm = axial_force_n * reference_m;
        let sheared_m = length_m + load_nm * self.shear_per_n;
        let argument = load_nm * self.load_per_n_m2 * sheared_m;
        let bending = length_m * self.bending_per_n_m2 * sheared_m;
        let EntireFunctions { c0, g0, g1, .. } = EntireFunctions::at(used(argument));
        let flexibility = g0 * self.shear_per_n + bending * g1;
        // One division for all three denominators.
        let inverse = (reference_m * g0 * flexibility).inverse();
        let bow_nm_per_rad = c0 * self.bow_n_m2 * flexibility * inverse;
        let sway_n_per_rad = sheared_m * 0.5 * (g0 * g0) * inverse;
        let strong = argument.below(EntireFunctions::MIN_ARGUMENT);
        if !R::any(strong) {
            return EndStiffness { bow_nm_per_rad, sway_n_per_rad, sheared_m, argument };
        }
        let StabilityFunctions { bow, sway, .. } = StabilityFunctions::in_strong_tension(argument);
        let [strong_bow, strong_sway] = [
            bow * self.bow_n_m2 / reference_m,
            sheared_m * 0.5 / (reference_m * (bending * sway + self.shear_per_n)),
        ];
        EndStiffness {
            bow_nm_per_rad: R::select(strong, strong_bow, bow_nm_per_rad),
            sway_n_per_rad: R::select(strong, strong_sway, sway_n_per_rad),
            sheared_m,
            argument,
        }
    }
}

/// End stiffnesses of the printed law or of its correction, see [`Column::ends`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct EndStiffness<R = f64> {
    /// `a - b` (N·m/rad).
    pub bow_nm_per_rad: R,
    /// `(a + b) / L` (N/rad): transverse force per sum of the end angles.
    pub sway_n_per_rad: R,
    /// `Lam` (m); if not positive, the rod has no shear stiffness, and the end stiffnesses are meaningless.
    pub sheared_m: R,
    /// Argument `z = (q L)² / 4` of the load, not saturated; `pi²` is the first pole of the bow.
    pub argument: R,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    #[test]
    fn unloaded_rod_has_the_textbook_stiffness() {
        let rigidities = *Preset::Thesis1.spring().rigidities();
        let length_m = 0.025;
        let rest = Column::new(&rigidities).ends(0.0, length_m, length_m);
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
        let column = Column::new(rigidities).ends(load_n, length_m, free_length_m);
        // Rounding of a dozen operations on a value near ten.
        assert!((column.argument - std::f64::consts::PI.powi(2)).abs() < 1e-13);
    }
}
