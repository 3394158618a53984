//! Variant `energy`: the spring as one stored energy, in three dimensions.
//!
//! The thesis computes forces in two planes and turns them one after the other; the result depends on the order of the
//! axes, and closed paths generate energy. Here the spring is a single function of the pose, the energy `W`, and force and
//! torque are its exact derivatives. So the work on a closed path is zero, a rotation of the pose about the axis rotates the
//! wrench, and there is one law for all directions.
//!
//! Directions: `k` the lower plate's normal, `t` the upper plate's, `e` the chord between the plate centres, of
//! length `L`; `th` are the angles between them, `w` is the twist of the upper plate, the rotation left over
//! about the axis after the shortest turn from `k` to `t`.
//!
//! ```text
//! W = gamma (L0 - L)² / (2 L0)                         compression
//!   + (a + b)/2 (th_ke² + th_te²) - b/2 th_kt²         sway and bow, end stiffnesses a, b of the length L
//!   + tau/(2 L0) (w + kt e.(k x t))²                   torsion, with the writhe of the bent axis
//!   + W4(L, th)                                        bending at fourth order
//! ```
//!
//! The bending part is the linear beam-column with rigidities per current length, written in invariants
//! ([`crate::bending`]); its end stiffnesses depend on `L`, and their derivative is the axial force that bending
//! causes (the thesis leaves it out). The torsion term couples bending out of plane and twisting. With the term
//! of [`crate::quartic`] the energy is that of the exact rod to fourth order in the bending angles at any
//! compression; the error of the wrench is of fifth order in them, of third order where the plate is twisted as
//! well.
//!
//! Near buckling (`G0` towards zero, see [`flotor_lanes::entire`]) the bow stiffness runs to minus infinity. Short of
//! the pole its argument saturates, see [`KNEE`](crate::shape::KNEE): beyond, the spring has the stiffness of a spring just
//! before buckling. `W` stays a smooth function of the pose.
//!
//! Derivation: the end stiffnesses are those of Haringx; the invariant form and the fourth order are this
//! project's, in the book's chapter "The spring".

use crate::bending::{Bending, BendingEnergy};
use crate::pose::{Coordinates, Pose, Span};
use crate::response::{Demand, LaneResponse, Law, Response};
use crate::rigidity::Spring;
use flotor_lanes::angle::{TRUSTED_VERSINE, measures};
use flotor_lanes::{Real, Vector};

/// Smallest `1 + k.t`, at 177.4 degrees: the twist is undefined for a plate turned upside down.
const LEAST_OVERTURN: f64 = 1e-3;

/// Conservative law of one spring, with prepared constants.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct EnergyForm {
    free_length_m: f64,
    /// `gamma / L0`
    axial_n_per_m: f64,
    /// `tau / L0`
    torsion_nm_per_rad: f64,
    bending: Bending,
}

impl EnergyForm {
    /// Prepares the law. Real-time: bounded, no allocation; tens of microseconds, to fit
    /// the fourth-order coefficients.
    pub fn new(spring: &Spring) -> Self {
        Self::with_bending(spring, Bending::new(spring))
    }

    /// Returns the law of `to`, derived from this law of `from`. Equal to [`Self::new`], but takes only nanoseconds
    /// where the stiffness has changed and not the proportions. Real-time: bounded, no allocation.
    pub fn retuned(&self, from: &Spring, to: &Spring) -> Self {
        if to.is_proportional_to(from) {
            Self::with_bending(to, self.bending.restiffened(to))
        } else {
            Self::new(to)
        }
    }

    fn with_bending(spring: &Spring, bending: Bending) -> Self {
        let free_length_m = spring.geometry().free_length_m;
        Self {
            free_length_m,
            axial_n_per_m: spring.axial_stiffness_n_per_m(),
            torsion_nm_per_rad: spring.rigidities().tau_n_m2 / free_length_m,
            bending,
        }
    }

    /// Returns the wrench on the hand and the stored energy at a pose. Real-time: bounded, no allocation.
    ///
    /// Defined for every pose:
    /// - past the solid length the law continues, without coil contact;
    /// - beyond [`KNEE`](crate::shape::KNEE) (close to buckling and past it), or where an angle between normals
    ///   and chord or the twist exceeds 60 degrees, up to an upper plate below the lower one: still the
    ///   derivative of the same smooth `W`, but `W` is a continuation, [`Validity::Clamped`](crate::validity::Validity::Clamped);
    /// - upper plate upside down to within 2.6 degrees, plates closer than a thousandth or farther than a
    ///   million free lengths, for a wire with `G > E` also any length at which the rod has no shear stiffness:
    ///   no wrench, [`Validity::OutOfDomain`](crate::validity::Validity::OutOfDomain);
    /// - NaN, infinity or a quaternion not of unit length: no wrench, [`Validity::InvalidInput`](crate::validity::Validity::InvalidInput).
    pub fn respond(&self, pose: &Pose, demand: Demand) -> Response {
        self.respond_at(pose, demand)
    }
}

impl Law for EnergyForm {
    const HAS_ENERGY: bool = true;

    /// Returns `F = -dW/dr`, `M = -dW/d(rotation)`, `W`.
    #[inline(always)]
    fn evaluate<R: Real>(&self, at: &Coordinates<R>, demand: Demand) -> LaneResponse<R> {
        let Span { vector_m, length_m, shortening_m, usable } = at.span(self.free_length_m);
        let inverse_length = length_m.inverse();
        let directions = Directions::new(vector_m, length_m, inverse_length, at.orientation);
        let sheared_length_m = self.bending.sheared_length_m(length_m, shortening_m);
        let answered = usable & directions.overturn.above(LEAST_OVERTURN) & sheared_length_m.above(0.0);
        // Early exit: a single pose without an answer needs no further computation.
        if !R::any(answered) {
            return LaneResponse::none(length_m, answered);
        }
        let Directions { versines, twist_versine, twist_sine, .. } = directions;
        let (angles, twist) = measures(versines, twist_versine, twist_sine);
        let bending = self.bending.at(length_m, shortening_m, &angles);
        let BendingEnergy { by_squares, writhe, writhe_slope, saturated, .. } = bending;

        let Directions { chord: e, upper: t, .. } = directions;
        // Derivatives with respect to the versines of lower normal to chord, upper normal to chord, lower to upper normal.
        let by_lower = by_squares[0] * angles[0].slope;
        let by_upper = by_squares[1] * angles[1].slope;
        let by_plates = by_squares[2] * angles[2].slope;

        // e.(k x t), with k = (0, 0, 1)
        let writhe_area = e.y * t.x - e.x * t.y;
        let wound = writhe * writhe_area + twist.value;
        let torsion_nm = wound * self.torsion_nm_per_rad;
        let (coupling_nm, coupling_slope) = (torsion_nm * writhe, torsion_nm * writhe_slope);

        let by_length = coupling_slope * writhe_area + bending.by_length - shortening_m * self.axial_n_per_m;
        // Differences from e instead of k and t themselves: the projection removes e, and nothing is left to
        // cancel near rest.
        let zero = length_m.like(0.0);
        let bent = directions.chord_from_lower * by_lower + directions.chord_from_upper * by_upper;
        let by_direction = Vector::new(bent.x - t.y * coupling_nm, bent.y + t.x * coupling_nm, bent.z);
        let tangential = by_direction - e * by_direction.dot(e);
        let force_n = e * -by_length - tangential * inverse_length;

        let torque_nm = if demand >= Demand::Wrench {
            let by_upper_normal = Vector::new(
                e.y * coupling_nm - e.x * by_upper,
                -(e.x * coupling_nm + e.y * by_upper),
                -(e.z * by_upper + by_plates),
            );
            // A small rotation changes the twist by its component along (t + k) / (1 + k.t).
            let twist_axis = Vector::new(t.x, t.y, directions.overturn);
            let twist_nm = torsion_nm * twist.slope * directions.inverse_overturn;
            by_upper_normal.cross(t) - twist_axis * twist_nm
        } else {
            Vector::new(zero, zero, zero)
        };
        let energy_j = if demand >= Demand::WrenchAndEnergy {
            let axial_j = shortening_m * shortening_m * (0.5 * self.axial_n_per_m);
            axial_j + bending.energy_j + torsion_nm * wound * 0.5
        } else {
            zero
        };
        LaneResponse { force_n, torque_nm, energy_j, answered, trusted: directions.trusted(saturated) }
    }
}

/// Unit vectors of a pose and measures of the angles between them.
struct Directions<R> {
    chord: Vector<R>,
    upper: Vector<R>,
    chord_from_lower: Vector<R>,
    chord_from_upper: Vector<R>,
    /// `1 - cos` of the angles lower normal to chord, upper normal to chord, lower to upper normal.
    versines: [R; 3],
    /// `1 + k.t`
    overturn: R,
    inverse_overturn: R,
    twist_sine: R,
    twist_versine: R,
}

impl<R: Real> Directions<R> {
    #[inline(always)]
    fn new(chord_m: Vector<R>, length_m: R, inverse_length: R, orientation: [R; 4]) -> Self {
        let [x, y, z, w] = orientation;
        // The difference first: e is then exactly (0, 0, 1) at rest.
        let rise = (chord_m.z - length_m) * inverse_length;
        let (aside_x, aside_y) = (chord_m.x * inverse_length, chord_m.y * inverse_length);
        let chord = Vector::new(aside_x, aside_y, rise + 1.0);
        let tilt = (x * x + y * y) * 2.0;
        let upper = Vector::new((x * z + w * y) * 2.0, (y * z - w * x) * 2.0, tilt.like(1.0) - tilt);
        let chord_from_lower = Vector::new(aside_x, aside_y, rise);
        let chord_from_upper = Vector::new(aside_x - upper.x, aside_y - upper.y, rise + tilt);
        let overturn = tilt.like(2.0) - tilt;
        let inverse_overturn = overturn.inverse();
        // The twist part of the quaternion is (z, w) of squared norm (1 + k.t) / 2; double-angle formulas.
        let scale = inverse_overturn * 4.0;
        Self {
            chord,
            upper,
            chord_from_lower,
            chord_from_upper,
            versines: [
                chord_from_lower.dot(chord_from_lower) * 0.5,
                chord_from_upper.dot(chord_from_upper) * 0.5,
                tilt,
            ],
            overturn,
            inverse_overturn,
            twist_sine: scale * (w * z),
            twist_versine: scale * (z * z),
        }
    }

    /// Returns the lanes in which all angles are within the trusted range of their measures and the argument is not saturated.
    #[inline(always)]
    fn trusted(&self, saturated: R::Mask) -> R::Mask {
        let [lower, upper, plates] = self.versines;
        // A saturated lane counts as an angle out of range: no complement of a mask is needed.
        let beyond = R::select(saturated, lower.like(2.0), self.twist_versine);
        lower.below(TRUSTED_VERSINE)
            & upper.below(TRUSTED_VERSINE)
            & plates.below(TRUSTED_VERSINE)
            & beyond.below(TRUSTED_VERSINE)
    }
}
