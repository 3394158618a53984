//! Straight column along the chord: initial shape and curvature of a search for the equilibrium.
//!
//! With the force `N` that compresses it to the chord's length, `sigma = 1 + softening N`, the energy of the column is
//!
//! ```text
//! W2 = 1/2 ∫ theta'² + N sigma/2 ∫ theta² + sigma²/(2 shear compliance) (∫ theta)²
//! ```
//!
//! for small turns `theta` of its sections. In the bubbles of [`flotor_lanes::basis`] its matrix of second derivatives
//! is tridiagonal, for the even and the odd bubbles separately. The chord of the bent column is shorter than its arc by
//! `1/2 ∫ theta²`, which reduces the compression; if the reduction is large, the column is bent again with the reduced
//! force. Without this step its bend would be unbounded close to buckling.
//!
//! Source: Haringx, as in [`crate::bending`].

use flotor_hal::glam::{DVec2, DVec3};
use pulp::Simd;

use super::functional::Ratios;
use super::plate::Plate;
use super::search_energy::{FOURS, Four, Fours, dot, four};
use flotor_lanes::{Real, Wide};

/// Lower limit of the curvature, relative to a rod without load: close to buckling the angles themselves stiffen the rod.
const LEAST_CURVATURE: f64 = 0.2;
/// Reduction of the compression by the bend, in `alpha/L0²`, above which the column is bent again: a few hundredths of
/// the buckling load.
const SMALL_FORCE: f64 = 2.0;
/// Row at which the factorisations from both ends of the matrix meet.
const MIDDLE: usize = FOURS / 2;

/// Integrals of products of bubbles, in the order of the coefficients.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Products {
    /// Integral of the square of each bubble.
    square: [Four; FOURS],
    /// Integral of each bubble times the bubble two degrees lower.
    with_lower: [Four; FOURS],
}

/// Factored matrix of second derivatives of a column's energy.
pub(super) struct Column<S: Simd> {
    inverse_pivot: Fours<S>,
    /// Elimination factors: of each row by the row before, up to the middle; from there on of the row before by each row.
    factor: Fours<S>,
    pub(super) is_buckled: bool,
}

/// Ends of the rod relative to the chord, in `p`.
struct Ends {
    /// Integrals of the straight line between the ends times the first two bubbles, of opposite sign.
    mean: DVec2,
    tilt: DVec2,
    /// Integral of the square of this line.
    square: f64,
}

impl Ends {
    #[inline(always)]
    fn new(chord: DVec2, upper: DVec2) -> Self {
        Self {
            // ∫ b_1 = -1/sqrt 12, ∫ (2 s - 1) b_2 = -1/(6 sqrt 5).
            mean: (0.5 * upper - chord) / 12.0f64.sqrt(),
            tilt: upper / (12.0 * 5.0f64.sqrt()),
            square: chord.length_squared() - chord.dot(upper) + upper.length_squared() / 3.0,
        }
    }
}

impl<S: Simd> Column<S> {
    /// Solves the system of the column for the right-hand side `right`.
    #[inline(always)]
    pub(super) fn solve(&self, right: &Fours<S>) -> Fours<S> {
        let mut x = *right;
        for j in 1..=MIDDLE {
            x[j] = x[j] - self.factor[j] * x[j - 1];
        }
        for j in (MIDDLE + 1..FOURS).rev() {
            x[j - 1] = x[j - 1] - self.factor[j] * x[j];
        }
        for (x, inverse) in x.iter_mut().zip(&self.inverse_pivot) {
            *x = *x * *inverse;
        }
        for j in (1..=MIDDLE).rev() {
            x[j - 1] = x[j - 1] - self.factor[j] * x[j];
        }
        for j in MIDDLE + 1..FOURS {
            x[j] = x[j] - self.factor[j] * x[j - 1];
        }
        x
    }
}

impl Products {
    pub(super) fn new() -> Self {
        let (mut square, mut with_lower) = ([[0.0; 4]; FOURS], [[0.0; 4]; FOURS]);
        for j in 0..FOURS {
            for lane in 0..4 {
                // Of degree n: integrals of b_n² and b_n b_(n-2).
                let n = (2 * j + lane / 2 + 1) as f64;
                square[j][lane] = 0.5 / ((2.0 * n - 1.0) * (2.0 * n + 3.0));
                if j > 0 {
                    with_lower[j][lane] =
                        -0.25 / ((2.0 * n - 1.0) * ((2.0 * n + 1.0) * (2.0 * n - 3.0)).sqrt());
                }
            }
        }
        Self { square, with_lower }
    }

    /// Returns the column along the chord between the plates, and its shape, bent between the ends of the rod to first
    /// order in their leans from the chord; unusable if buckled. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn column<S: Simd>(&self, simd: S, ratios: &Ratios, plate: &Plate) -> (Column<S>, Fours<S>) {
        let chord = plate.displacement + DVec3::Z;
        let length = chord.length();
        // `p` of the chord, and the scale `w` of angles in `p` there.
        let lean = DVec2::new(chord.x, chord.y) / (length + chord.z);
        let scale = 2.0 / (1.0 + lean.length_squared());
        let (inverse_square, compliance) =
            (1.0 / (scale * scale), ratios.shear_compliance + ratios.softening);
        let ends = Ends::new(lean, plate.lean);
        let mut force = (length - 1.0) / compliance;
        let (mut column, mut shape) = self.bent(simd, ratios, force, &ends);

        let arch = self.arch(simd, &ends, &shape);
        let mut twice = arch;
        twice[0] = twice[0] + straight(simd, &ends);
        let shortening = 0.5 * scale * scale * (ends.square + dot(&shape, &twice));
        if shortening > SMALL_FORCE * compliance {
            // One Newton step for the force: the bend decreases with the compressing force.
            let fall = (1.0 + 2.0 * ratios.softening * force) * dot(&arch, &column.solve(&arch));
            force += shortening / (compliance + scale * scale * fall);
            (column, shape) = self.bent(simd, ratios, force, &ends);
        }
        for inverse in &mut column.inverse_pivot {
            *inverse = *inverse * inverse_square;
        }
        (column, shape)
    }

    /// Returns the column under a force, and its shape; the curvature excludes the scale of the angles.
    #[inline(always)]
    fn bent<S: Simd>(&self, simd: S, ratios: &Ratios, force: f64, ends: &Ends) -> (Column<S>, Fours<S>) {
        let Ratios { shear_compliance, softening, .. } = *ratios;
        let sigma = 1.0 + softening * force;
        let (load, sway) = (force * sigma, sigma * sigma / shear_compliance);
        let zero = four(simd, [0.0; 4]);
        let (mut pivot, mut factor, mut inverse_pivot) = ([zero; FOURS], [zero; FOURS], [zero; FOURS]);
        for (pivot, square) in pivot.iter_mut().zip(&self.square) {
            *pivot = four(simd, *square) * load + 1.0;
        }
        // (∫ b_1)² = 1/12; the other bubbles have no mean.
        pivot[0] = pivot[0] + four(simd, [sway / 12.0, sway / 12.0, 0.0, 0.0]);
        for j in 1..=MIDDLE {
            let product = four(simd, self.with_lower[j]) * load;
            factor[j] = product / pivot[j - 1];
            pivot[j] = pivot[j] - factor[j] * product;
        }
        for j in (MIDDLE + 1..FOURS).rev() {
            let product = four(simd, self.with_lower[j]) * load;
            factor[j] = product / pivot[j];
            pivot[j - 1] = pivot[j - 1] - factor[j] * product;
        }
        let mut buckled = pivot[0].below(f64::MIN_POSITIVE);
        for (inverse, pivot) in inverse_pivot.iter_mut().zip(&pivot) {
            buckled = buckled | pivot.below(f64::MIN_POSITIVE);
            *inverse = pivot.at_least(LEAST_CURVATURE).inverse();
        }
        let column = Column { inverse_pivot, factor, is_buckled: Wide::<S>::any(buckled) };
        // Against the slope of W2 at the straight line between the ends.
        let mut right = [zero; FOURS];
        let (mean, tilt) = ((load + sway) * ends.mean, load * ends.tilt);
        right[0] = four(simd, [mean.x, mean.y, tilt.x, tilt.y]);
        let shape = column.solve(&right);
        (column, shape)
    }

    /// Returns the integrals of the bend relative to the chord, times each bubble.
    #[inline(always)]
    fn arch<S: Simd>(&self, simd: S, ends: &Ends, shape: &Fours<S>) -> Fours<S> {
        let mut arch = *shape;
        for (arch, square) in arch.iter_mut().zip(&self.square) {
            *arch = *arch * four(simd, *square);
        }
        for j in 1..FOURS {
            let product = four(simd, self.with_lower[j]);
            arch[j] = arch[j] + product * shape[j - 1];
            arch[j - 1] = arch[j - 1] + product * shape[j];
        }
        arch[0] = arch[0] + straight(simd, ends);
        arch
    }
}

/// Returns the part of the straight line between the ends in [`Products::arch`].
#[inline(always)]
fn straight<S: Simd>(simd: S, ends: &Ends) -> Wide<S> {
    four(simd, [-ends.mean.x, -ends.mean.y, -ends.tilt.x, -ends.tilt.y])
}
