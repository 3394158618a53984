//! Variant `energy`: the spring as one stored energy, in three dimensions.
//!
//! The thesis computes forces in two planes and turns them one after the other; what comes out depends on the
//! order of the axes and pumps energy into the hand. Here the spring is a single function of the pose, the
//! energy `W`, and force and torque are its exact derivatives. So no closed path gains or loses work, turning
//! everything about the axis turns the answer, and there is one law for all directions.
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
//! Near buckling (`G0` towards zero, see [`crate::entire`]) the bow stiffness runs to minus infinity. Short of
//! the pole its argument levels off, see [`KNEE`](crate::bending::KNEE): the spring goes on from there as one
//! that is about to buckle and never does. `W` stays a smooth function of the pose.
//!
//! Derivation: the end stiffnesses are those of Haringx; the invariant form and the fourth order are this
//! project's, in the book's chapter "The spring".

use flotor_hal::glam::{DQuat, DVec3};

use crate::angle::{SquaredAngle, TRUSTED_VERSINE, Twist};
use crate::bending::{Bending, BendingEnergy};
use crate::pose::{Chord, Pose};
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::validity::Validity;

/// Smallest `1 + k.t`. The twist has no meaning for a plate turned upside down; this is 177.4 degrees.
const LEAST_OVERTURN: f64 = 1e-3;

/// The conservative law of one spring, its constants prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    #[must_use]
    pub fn new(spring: &Spring) -> Self {
        let free_length_m = spring.geometry().free_length_m;
        Self {
            free_length_m,
            axial_n_per_m: spring.axial_stiffness_n_per_m(),
            torsion_nm_per_rad: spring.rigidities().tau_n_m2 / free_length_m,
            bending: Bending::new(spring),
        }
    }

    /// Wrench on the hand and stored energy at a pose. Real-time: bounded, no allocation.
    ///
    /// Total over all poses:
    /// - past the solid length the law goes on, it knows no coil contact;
    /// - beyond [`KNEE`](crate::bending::KNEE) (close to buckling and past it), or where an angle between normals
    ///   and chord or the twist exceeds 60 degrees, up to an upper plate below the lower one: still the
    ///   derivative of the same smooth `W`, but `W` is a continuation, [`Validity::Clamped`];
    /// - upper plate upside down to within 2.6 degrees, plates closer than a thousandth or farther than a
    ///   million free lengths, for a wire with `G > E` also any length at which the rod has no shear stiffness
    ///   left: no wrench, [`Validity::OutOfDomain`];
    /// - NaN, infinity or a quaternion that is not of unit length: no wrench, [`Validity::InvalidInput`].
    #[must_use]
    pub fn respond(&self, pose: &Pose, demand: Demand) -> Response {
        let chord = match pose.chord(self.free_length_m) {
            Ok(chord) => chord,
            Err(validity) => return Response::none(validity),
        };
        let directions = Directions::new(&chord, pose.orientation);
        let angles = directions.versines.map(SquaredAngle::from_versine);
        match self.bending.at(&chord, &angles) {
            Some(bending) if directions.overturn >= LEAST_OVERTURN => {
                self.differentiate(&chord, &directions, &angles, &bending, demand)
            }
            _ => Response::none(Validity::OutOfDomain),
        }
    }

    /// `F = -dW/dr`, `M = -dW/d(rotation)`, `W`.
    #[inline]
    fn differentiate(
        &self,
        chord: &Chord,
        directions: &Directions,
        angles: &[SquaredAngle; 3],
        bending: &BendingEnergy,
        demand: Demand,
    ) -> Response {
        let Directions { chord: e, upper: t, .. } = *directions;
        // Derivatives by the versines of lower normal to chord, upper normal to chord, lower to upper normal.
        let [lower, upper, plates] = [0, 1, 2].map(|i| bending.by_squares[i] * angles[i].slope);

        let twist = Twist::from_sine(directions.twist_sine, directions.twist_versine);
        // e.(k x t), with k = (0, 0, 1)
        let writhe_area = e.y * t.x - e.x * t.y;
        let wound = twist.value + bending.writhe * writhe_area;
        let torsion_nm = self.torsion_nm_per_rad * wound;
        let coupling_nm = torsion_nm * bending.writhe;

        let by_length = bending.by_length - self.axial_n_per_m * chord.shortening_m
            + torsion_nm * bending.writhe_slope * writhe_area;
        // Differences from e instead of k and t themselves: the projection removes e, and nothing is left to
        // cancel near rest.
        let by_direction = lower * directions.chord_from_lower
            + upper * directions.chord_from_upper
            + coupling_nm * DVec3::new(-t.y, t.x, 0.0);
        let tangential = by_direction - by_direction.dot(e) * e;
        let force_n = -by_length * e - tangential / chord.length_m;

        let torque_nm = if demand >= Demand::Wrench {
            let by_upper_normal =
                coupling_nm * DVec3::new(e.y, -e.x, 0.0) - upper * e - DVec3::new(0.0, 0.0, plates);
            // A small rotation changes the twist by its component along (t + k) / (1 + k.t).
            let twist_axis = DVec3::new(t.x, t.y, directions.overturn) / directions.overturn;
            by_upper_normal.cross(t) - torsion_nm * twist.slope * twist_axis
        } else {
            DVec3::ZERO
        };

        let axial_j = 0.5 * self.axial_n_per_m * (chord.shortening_m * chord.shortening_m);
        let energy_j = axial_j + bending.energy_j + 0.5 * torsion_nm * wound;
        let validity =
            if bending.levelled || !directions.trusted() { Validity::Clamped } else { Validity::Ok };
        let energy_j = (demand >= Demand::WrenchAndEnergy).then_some(energy_j);
        Response { force_n, torque_nm, energy_j, validity }
    }
}

/// Unit vectors of a pose and how far they are apart.
struct Directions {
    chord: DVec3,
    upper: DVec3,
    chord_from_lower: DVec3,
    chord_from_upper: DVec3,
    /// `1 - cos` of the angles lower normal to chord, upper normal to chord, lower to upper normal.
    versines: [f64; 3],
    /// `1 + k.t`
    overturn: f64,
    twist_sine: f64,
    twist_versine: f64,
}

impl Directions {
    #[inline]
    fn new(chord: &Chord, orientation: DQuat) -> Self {
        let DQuat { x, y, z, w } = orientation;
        // Divided, not multiplied by the inverse: e is then exactly (0, 0, 1) at rest.
        let e = chord.vector_m / chord.length_m;
        let tilt = 2.0 * (x * x + y * y);
        let upper = DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - tilt);
        let chord_from_lower = DVec3::new(e.x, e.y, e.z - 1.0);
        let chord_from_upper = e - upper;
        let overturn = 2.0 - tilt;
        // The twist part of the quaternion is (z, w) of squared norm (1 + k.t) / 2; double-angle formulas.
        let scale = 4.0 / overturn;
        Self {
            chord: e,
            upper,
            chord_from_lower,
            chord_from_upper,
            versines: [
                0.5 * chord_from_lower.length_squared(),
                0.5 * chord_from_upper.length_squared(),
                tilt,
            ],
            overturn,
            twist_sine: scale * (w * z),
            twist_versine: scale * (z * z),
        }
    }

    #[inline]
    fn trusted(&self) -> bool {
        let [lower, upper, plates] = self.versines;
        lower.max(upper).max(plates).max(self.twist_versine) <= TRUSTED_VERSINE
    }
}
