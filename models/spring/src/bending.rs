//! Energy of bending as a function of the chord's length and three angles.
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

use crate::angle::SquaredAngle;
use crate::beam_column::StabilityFunctions;
use crate::level::{Levelled, level_above};
use crate::pose::Chord;
use crate::quartic::{Quartic, QuarticEnergy};
use crate::rigidity::Spring;

/// Argument `z` from which on it is bent off its course to the pole at 9.87, where the column buckles. Here
/// `G0 = 0.062` and the bow stiffness is -16 times that of the unloaded rod.
pub const KNEE: f64 = 8.75;

/// How much further `z` can get: to 9.25 at most (`G0 = 0.033`, bow stiffness -30 times).
pub const REACH: f64 = 0.5;

/// The argument kept short of the pole.
#[inline]
pub(crate) fn levelled_argument(z: f64) -> Levelled {
    level_above(z, KNEE, REACH)
}

/// Bending of one spring, its constants prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bending {
    /// `2 alpha / L0`: bow stiffness without load.
    bow_nm_per_rad: f64,
    /// `beta / (2 L0)`
    shear_n_per_m: f64,
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
        let rigidities = spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        Self {
            bow_nm_per_rad: 2.0 * rigidities.alpha_n_m2 / free_length_m,
            shear_n_per_m: rigidities.beta_n / (2.0 * free_length_m),
            slenderness_per_m2: rigidities.beta_n / (12.0 * rigidities.alpha_n_m2),
            shear_compliance: rigidities.gamma_n / rigidities.beta_n,
            load_per_m2: rigidities.gamma_n / (4.0 * rigidities.alpha_n_m2),
            quartic: Quartic::new(rigidities, free_length_m),
        }
    }

    /// Energy and derivatives; `None` where the rod has no shear stiffness left, possible only for `G > E`.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn at(&self, chord: &Chord, angles: &[SquaredAngle; 3]) -> Option<BendingEnergy> {
        let sheared_length_m = chord.length_m + self.shear_compliance * chord.shortening_m;
        if sheared_length_m <= 0.0 {
            return None;
        }
        let sheared_slope = 1.0 - self.shear_compliance;
        let argument = levelled_argument(self.load_per_m2 * chord.shortening_m * sheared_length_m);
        let z_by_length =
            argument.slope * self.load_per_m2 * (chord.shortening_m * sheared_slope - sheared_length_m);
        let stability = StabilityFunctions::at(argument.value);

        let area_m2 = sheared_length_m * chord.length_m;
        let area_slope = sheared_length_m + chord.length_m * sheared_slope;
        let slenderness = self.slenderness_per_m2;
        let inverse = 1.0 / (1.0 + slenderness * area_m2 * stability.sway);
        let denominator_slope =
            slenderness * (area_slope * stability.sway + area_m2 * stability.sway_slope * z_by_length);

        let sway = self.shear_n_per_m * area_m2 * inverse;
        let sway_slope = (self.shear_n_per_m * area_slope - sway * denominator_slope) * inverse;
        let bow = self.bow_nm_per_rad * stability.bow;
        let bow_slope = self.bow_nm_per_rad * stability.bow_slope() * z_by_length;
        let writhe = slenderness * area_m2 * stability.writhe * inverse;
        let writhe_numerator_slope =
            slenderness * (area_slope * stability.writhe + area_m2 * stability.writhe_slope() * z_by_length);
        let writhe_slope = (writhe_numerator_slope - writhe * denominator_slope) * inverse;

        let squares = angles.map(|angle| angle.value);
        let QuarticEnergy { energy_j, by_squares, by_length } =
            self.quartic.at(chord.length_m, argument.value, z_by_length, squares);
        let (ends, plates) = (0.5 * (squares[0] + squares[1]), 0.5 * squares[2]);
        let (carry, carry_slope) = (0.5 * (sway - bow), 0.5 * (sway_slope - bow_slope));
        Some(BendingEnergy {
            energy_j: sway * ends - carry * plates + energy_j,
            by_squares: [0.5 * sway + by_squares[0], 0.5 * sway + by_squares[1], by_squares[2] - 0.5 * carry],
            by_length: sway_slope * ends - carry_slope * plates + by_length,
            writhe,
            writhe_slope,
            levelled: argument.bent,
        })
    }
}

/// The energy and its partial derivatives.
pub(crate) struct BendingEnergy {
    pub(crate) energy_j: f64,
    /// By the squared angles lower normal to chord, upper normal to chord, lower to upper normal.
    pub(crate) by_squares: [f64; 3],
    /// By the length of the chord.
    pub(crate) by_length: f64,
    /// `kt`, see the module.
    pub(crate) writhe: f64,
    /// Its derivative by the length of the chord.
    pub(crate) writhe_slope: f64,
    /// Whether the argument was kept short of the pole.
    pub(crate) levelled: bool,
}
