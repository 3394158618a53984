//! Bending energy as a function of the chord's length and three angles.
//!
//! ```text
//! E = (a + b)/2 (th_ke² + th_te²) - b/2 th_kt² + W4
//! ```
//!
//! with the angles between lower normal `k`, upper normal `t` and chord `e`, end stiffnesses `a`, `b` of the
//! linear column with rigidities per current length, and the fourth-order term of [`crate::quartic`]. With
//! `Lam = L + (gamma / beta) (L0 - L)` and `z = gamma (L0 - L) Lam / (4 alpha)`,
//!
//! ```text
//! a - b = (2 alpha / L0) C0 / G0          a + b = (Lam L / (2 L0)) / (1/beta + Lam L G1 / (12 alpha G0))
//! kt = Lam L h / (12 alpha G0²) / (1/beta + Lam L G1 / (12 alpha G0))
//! ```
//!
//! where `kt` is the writhe of the axis: bent in one direction and swayed in the other, the rod winds.

use crate::quartic::{Quartic, QuarticEnergy};
use crate::rigidity::Spring;
use crate::shape::saturated_argument;
use flotor_lanes::Real;
use flotor_lanes::angle::SquaredAngle;
use flotor_lanes::stability::StabilityFunctions;

/// Prepared constants of the bending of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bending {
    /// `2 alpha / L0`: bow stiffness without load.
    bow_nm_per_rad: f64,
    /// `6 alpha / L0`: sway stiffness without load, of a rod that does not shear.
    sway_nm_per_rad: f64,
    /// `beta / (12 alpha)`: shear to bending stiffness.
    slenderness_per_m2: f64,
    /// `gamma / beta`
    shear_compliance: f64,
    /// `gamma / (4 alpha)`
    load_per_m2: f64,
    quartic: Quartic,
}

impl Bending {
    pub(crate) fn new(spring: &Spring) -> Self {
        Self::with_quartic(spring, Quartic::new(spring))
    }

    /// Returns the constants of a spring of other stiffness but equal proportions. Real-time: bounded, no allocation.
    pub(crate) fn restiffened(&self, spring: &Spring) -> Self {
        Self::with_quartic(spring, self.quartic.with_gamma(spring.rigidities().gamma_n))
    }

    fn with_quartic(spring: &Spring, quartic: Quartic) -> Self {
        let rigidities = spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        Self {
            // Stiffnesses at rest, 2 alpha / L0 and 6 alpha / L0, and the constants of their formulas.
            bow_nm_per_rad: 2.0 * rigidities.alpha_n_m2 / free_length_m,
            sway_nm_per_rad: 6.0 * rigidities.alpha_n_m2 / free_length_m,
            slenderness_per_m2: rigidities.beta_n / (12.0 * rigidities.alpha_n_m2),
            shear_compliance: rigidities.gamma_n / rigidities.beta_n,
            load_per_m2: rigidities.gamma_n / (4.0 * rigidities.alpha_n_m2),
            quartic,
        }
    }

    /// Returns `Lam` (m). Where `Lam` is not positive, possible only for `G > E`, the rod has no shear stiffness and
    /// there is no bending. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn sheared_length_m<R: Real>(&self, length_m: R, shortening_m: R) -> R {
        length_m + shortening_m * self.shear_compliance
    }

    /// Returns the bending energy and its derivatives at a chord length, a shortening, and three squared angles: lower normal to
    /// chord, upper normal to chord, lower to upper normal. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn at<R: Real>(
        &self,
        length_m: R,
        shortening_m: R,
        angles: &[SquaredAngle<R>; 3],
    ) -> BendingEnergy<R> {
        // Terms of the length alone first: they are computed during the latency of the argument.
        let form = self.quartic.form_at(length_m);
        let sheared_length_m = self.sheared_length_m(length_m, shortening_m);
        let sheared_slope = length_m.like(1.0 - self.shear_compliance);
        let argument = saturated_argument(shortening_m * sheared_length_m * self.load_per_m2);
        let z_by_length =
            argument.slope * (shortening_m * sheared_slope - sheared_length_m) * self.load_per_m2;
        let stability = StabilityFunctions::at(argument.value);

        // Shear to bending stiffness of the length, `Lam L beta / (12 alpha)`.
        let shear = sheared_length_m * length_m * self.slenderness_per_m2;
        let shear_slope = (length_m * sheared_slope + sheared_length_m) * self.slenderness_per_m2;
        let inverse = (shear * stability.sway + 1.0).inverse();
        let denominator_slope = shear_slope * stability.sway + shear * (stability.sway_slope * z_by_length);

        let share = shear * inverse;
        let share_slope = (shear_slope - share * denominator_slope) * inverse;
        let (sway, sway_slope) = (share * self.sway_nm_per_rad, share_slope * self.sway_nm_per_rad);
        let bow = stability.bow * self.bow_nm_per_rad;
        let bow_slope = stability.bow_slope() * z_by_length * self.bow_nm_per_rad;
        let writhe = share * stability.writhe;
        let writhe_slope = share_slope * stability.writhe + share * (stability.writhe_slope() * z_by_length);

        let squares = [angles[0].value, angles[1].value, angles[2].value];
        let QuarticEnergy { energy_j, by_squares, by_length } =
            self.quartic.at(&form, argument.value, z_by_length, squares);
        let (ends, plates) = ((squares[0] + squares[1]) * 0.5, squares[2] * 0.5);
        let (half_sway, carry, carry_slope) =
            (sway * 0.5, (sway - bow) * 0.5, (sway_slope - bow_slope) * 0.5);
        BendingEnergy {
            energy_j: sway * ends + (energy_j - carry * plates),
            by_squares: [half_sway + by_squares[0], half_sway + by_squares[1], by_squares[2] - carry * 0.5],
            by_length: sway_slope * ends + (by_length - carry_slope * plates),
            writhe,
            writhe_slope,
            saturated: argument.saturated,
        }
    }
}

/// Energy of bending and its partial derivatives.
#[derive(Clone, Copy)]
pub(crate) struct BendingEnergy<R: Real> {
    pub(crate) energy_j: R,
    /// Derivatives with respect to the squared angles lower normal to chord, upper normal to chord, lower to upper normal.
    pub(crate) by_squares: [R; 3],
    /// Derivative with respect to the length of the chord.
    pub(crate) by_length: R,
    /// Writhe `kt`, see the module.
    pub(crate) writhe: R,
    /// Derivative of the writhe with respect to the length of the chord.
    pub(crate) writhe_slope: R,
    /// Lanes in which the argument was saturated short of the pole.
    pub(crate) saturated: R::Mask,
}
