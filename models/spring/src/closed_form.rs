//! Variants `closed-form` and `current-length`: the thesis's closed form without its branches.
//!
//! The thesis solves the linear beam-column in the two vertical planes separately, adds the axial force, and
//! turns each planar result from the chord back to the plates, first in one plane and then in the other
//! (section 3.2, appendix A). Its code switches formulas at the free length, returns NaN at rest and jumps at a length at
//! which the rod does not buckle. [`ClosedForm`] evaluates the same law through entire functions: one smooth
//! expression for compression, rest and elongation.
//!
//! [`Form::Printed`] reproduces the source, errors included: rigidities per unloaded length and the sum `M_U + M_L` as
//! the torque on the hand. It is for comparison only: it generates energy on closed paths. [`Form::CurrentLength`]
//! corrects both errors and is the exact linearisation of the rod in each plane. Both forms have the two successive
//! rotations, so neither is conservative in space; [`energy`](crate::energy) is.
//!
//! In the source's letters X, Z are horizontal and Y is vertical; here x = X, y = Z, z = Y. Its tilt angles
//! enter as `psi_Uz = psi_Lz - ry` and `psi_Ux = psi_Lx + rx` with the right-handed rotation vector (rx, ry, rz).

use crate::beam_column::{Column, TRUSTED_ARGUMENT};
use crate::pose::{Coordinates, Pose, Span};
use crate::precision::{Binary32, Binary64, Precision, Storage};
use crate::response::{Demand, LaneResponse, Law, Response};
use crate::rigidity::Spring;
use flotor_lanes::arctangent;
use flotor_lanes::{Pair, Real, Vector};

/// Form of the closed-form law: printed or corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// Form as printed in the thesis, errors included (variant `closed-form`).
    Printed,
    /// Printed form corrected: rigidities scaled by `L / L0`, torque `M_U` (variant `current-length`).
    CurrentLength,
}

/// Closed-form law of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct ClosedForm {
    form: Form,
    precision: Precision,
    column: Column,
    free_length_m: f64,
    axial_n_per_m: f64,
    yaw_nm_per_rad: f64,
}

impl ClosedForm {
    /// Prepares the law, in double precision. Real-time: bounded, no allocation.
    pub fn new(spring: &Spring, form: Form) -> Self {
        let rigidities = spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        Self {
            form,
            precision: Precision::Double,
            column: Column::new(rigidities),
            free_length_m,
            axial_n_per_m: rigidities.gamma_n / free_length_m,
            yaw_nm_per_rad: rigidities.tau_n_m2 / free_length_m,
        }
    }

    /// Sets the storage precision. Single precision causes an error of up to 1e-5 N in the workspace of the thesis. Real-time:
    /// bounded, no allocation.
    pub fn with_precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    /// Returns the wrench on the hand at a pose; this law has no energy. Real-time: bounded, no allocation.
    ///
    /// Defined for every pose:
    /// - past the solid length the law continues, without coil contact;
    /// - upper plate not above the lower plate: the formulas are continued, [`Validity::Clamped`](crate::validity::Validity);
    /// - near buckling (`G0` below 0.3) and past it: the argument is saturated short of the pole, so that the wrench stays
    ///   bounded, [`Validity::Clamped`](crate::validity::Validity);
    /// - elongated until no shear stiffness is left, plates closer than a thousandth or farther than a million free lengths: no
    ///   wrench, [`Validity::OutOfDomain`](crate::validity::Validity);
    /// - NaN, infinity or a quaternion that is not of unit length: no wrench,
    ///   [`Validity::InvalidInput`](crate::validity::Validity).
    pub fn respond(&self, pose: &Pose, demand: Demand) -> Response {
        self.respond_at(pose, demand)
    }

    #[inline(always)]
    fn evaluate_stored<R: Real, S: Storage>(&self, at: &Coordinates<R>, demand: Demand) -> LaneResponse<R> {
        let at = at.without_dust();
        let Vector { x, y, z } = at.position_m;
        let position_m = Vector::new(S::store(x), S::store(y), S::store(z));
        let Span { vector_m, length_m, shortening_m, usable } =
            Coordinates { position_m, ..at }.span(self.free_length_m);
        let Vector { x: turn_x, y: turn_y, z: turn_z } = at.rotation_vector_rad();
        let length_m = S::store(length_m);
        let axial_force_n = S::store(shortening_m * self.axial_n_per_m);
        let reference_m = match self.form {
            Form::Printed => length_m,
            Form::CurrentLength => length_m.like(self.free_length_m),
        };
        let column = self.column.bounded_ends(axial_force_n, length_m, reference_m);
        let (bow_nm, sway_n) = (S::store(column.bow_nm_per_rad), S::store(column.sway_n_per_rad));
        let height_m = vector_m.z;
        let planes = Planes::new::<S>(
            Pair(vector_m.x, vector_m.y),
            height_m,
            Pair(S::store(-turn_y), S::store(turn_x)),
        );

        // Chord to plates: about one axis, then about the other, as printed.
        let Pair(shear_x, shear_y) = planes.end_angle_sum_rad * Pair(-sway_n, -sway_n);
        let Pair(sine_x, sine_y) = planes.sine;
        let Pair(cosine_x, cosine_y) = planes.cosine;
        let (force_x, upright) = turn(S::store(shear_x), axial_force_n, sine_x, cosine_x);
        let (force_y, force_z) = turn(S::store(shear_y), S::store(upright), sine_y, cosine_y);
        let force_n = Vector::new(S::store(force_x), S::store(force_y), S::store(force_z));

        let zero = length_m.like(0.0);
        let torque_nm = if demand >= Demand::Wrench {
            // `M_U + M_L = (a - b) (psi_U - psi_L)` as printed, or `M_U = a psi_U + b psi_L`.
            let bow = planes.tilt_rad * Pair(bow_nm, bow_nm);
            let Pair(about_y_nm, about_x_nm) = match self.form {
                Form::Printed => bow,
                Form::CurrentLength => {
                    let sway_nm = sway_n * length_m;
                    (planes.end_angle_sum_rad * Pair(sway_nm, sway_nm) + bow) * 0.5
                }
            };
            let yaw_nm = turn_z * -self.yaw_nm_per_rad;
            Vector::new(S::store(-about_x_nm), S::store(about_y_nm), S::store(yaw_nm))
        } else {
            Vector::new(zero, zero, zero)
        };
        // Overflow gives no answer. One sum instead of six tests: the sum is finite only if every term is.
        let sum = (force_n.x + force_n.y + force_n.z) + (torque_nm.x + torque_nm.y + torque_nm.z);
        LaneResponse {
            force_n,
            torque_nm,
            energy_j: zero,
            answered: usable & column.sheared_m.above(0.0) & sum.finite(),
            trusted: height_m.above(0.0) & column.argument.below(TRUSTED_ARGUMENT),
        }
    }
}

impl Law for ClosedForm {
    const HAS_ENERGY: bool = false;

    #[inline(always)]
    fn evaluate<R: Real>(&self, at: &Coordinates<R>, demand: Demand) -> LaneResponse<R> {
        match self.precision {
            Precision::Double => self.evaluate_stored::<R, Binary64>(at, demand),
            Precision::Single => self.evaluate_stored::<R, Binary32>(at, demand),
        }
    }
}

/// Chord projection and end angles in the two vertical planes x, z and y, z.
#[derive(Clone, Copy)]
struct Planes<R> {
    /// Sine of the chord's inclination `psi_L`.
    sine: Pair<R>,
    /// Cosine of `psi_L`.
    cosine: Pair<R>,
    /// `psi_U - psi_L` (rad): minus the tilt of the upper plate towards the positive side.
    tilt_rad: Pair<R>,
    /// `psi_U + psi_L` (rad).
    end_angle_sum_rad: Pair<R>,
}

impl<R: Real> Planes<R> {
    #[inline(always)]
    fn new<S: Storage>(sideways_m: Pair<R>, height_m: R, tilt_rad: Pair<R>) -> Self {
        let height_m = Pair(height_m, height_m);
        let square = sideways_m * sideways_m + height_m * height_m;
        // A chord perpendicular to a plane has no inclination in that plane: treat the chord as upright.
        let nowhere = square.below(f64::MIN_POSITIVE);
        let (square, height_m) = if Pair::<R>::any(nowhere) {
            let unit = height_m.like(1.0);
            (Pair::select(nowhere, unit, square), Pair::select(nowhere, unit, height_m))
        } else {
            (square, height_m)
        };
        let length_m = square.sqrt();
        let base_m = length_m + height_m.abs();
        // One division for sine, cosine and the tangent of half the inclination.
        let inverse = (length_m * base_m).inverse();
        let per_length = base_m * inverse;
        let tangent = sideways_m * (length_m * inverse);
        let to_vertical_rad = tangent * 2.0 * arctangent::quotient(tangent * tangent);
        // Below the lower plate, measured from the vertical down: angles stay below 90 degrees, without a jump where
        // the chord hangs straight.
        let inclination_rad = S::store(to_vertical_rad);
        Self {
            sine: S::store(sideways_m * per_length),
            cosine: S::store(height_m * per_length),
            tilt_rad,
            end_angle_sum_rad: inclination_rad * 2.0 + tilt_rad,
        }
    }
}

/// Rotates components across and along the chord to horizontal and vertical.
#[inline(always)]
fn turn<R: Real>(across: R, along: R, sine: R, cosine: R) -> (R, R) {
    (across * cosine + along * sine, along * cosine - across * sine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use crate::validity::Validity;
    use flotor_hal::glam::DVec3;
    use std::f64::consts::PI;

    fn laws() -> impl Iterator<Item = ClosedForm> {
        Preset::ALL.into_iter().flat_map(|preset| {
            [Form::Printed, Form::CurrentLength].map(|form| ClosedForm::new(&preset.spring(), form))
        })
    }

    #[test]
    fn rest_pose_is_free_of_load() {
        for law in laws() {
            let rest = law.respond(&Pose::HOME, Demand::WrenchAndEnergy);
            assert_eq!((rest.force_n, rest.torque_nm), (DVec3::ZERO, DVec3::ZERO));
            assert_eq!((rest.validity, rest.energy_j), (Validity::Ok, None));
        }
    }

    #[test]
    fn axial_force_is_hookes_law() {
        for law in laws() {
            for z in [-0.003, -1e-9, 1e-9, 0.003] {
                let pose = Pose { position_m: DVec3::new(0.0, 0.0, z), ..Pose::HOME };
                let force_n = law.respond(&pose, Demand::Force).force_n;
                let hooke_n = -law.axial_n_per_m * z;
                // Four roundings in the cosine of each plane, four in the force, of half a unit each.
                assert!((force_n.z - hooke_n).abs() <= 1.4e-15 * hooke_n.abs());
                assert_eq!((force_n.x, force_n.y), (0.0, 0.0));
            }
        }
    }

    #[test]
    fn correct_law_leans_a_free_top_along_the_shove() {
        // D9: with no moment on it, the top of a shoved spring must lean towards the shove (ry > 0 for x > 0).
        let law = ClosedForm::new(&Preset::Thesis1.spring(), Form::CurrentLength);
        let torque_at = |ry| {
            let pose = Pose::from_rotation_vector(DVec3::new(0.002, 0.0, 0.0), DVec3::new(0.0, ry, 0.0));
            law.respond(&pose, Demand::Wrench).torque_nm.y
        };
        assert!(torque_at(0.0) > 0.0, "an upright top is pushed over towards the shove");
        assert!(torque_at(0.3) < 0.0, "and comes to rest there");
    }

    #[test]
    fn torque_appears_on_demand_only() {
        let law = ClosedForm::new(&Preset::Thesis2.spring(), Form::Printed);
        let pose = Pose::from_rotation_vector(DVec3::new(1e-3, -2e-3, -3e-3), DVec3::new(0.01, 0.02, -0.03));
        let (force, wrench) = (law.respond(&pose, Demand::Force), law.respond(&pose, Demand::Wrench));
        assert_eq!(force.force_n, wrench.force_n);
        assert_eq!(force.torque_nm, DVec3::ZERO);
        assert!(wrench.torque_nm.abs().min_element() > 0.0);
    }

    #[test]
    fn every_pose_gets_a_finite_answer() {
        let coordinates =
            [0.0, 1e-300, 1e-9, 1e-3, -5e-3, -0.025, -0.0249, -0.06, 0.1, 5.0, -1e9, 1e300, f64::NAN];
        let rotations = [0.0, 1e-300, 0.1, -2.0, PI, f64::INFINITY];
        for law in laws() {
            for x in coordinates {
                for z in coordinates {
                    for angle in rotations {
                        let position_m = DVec3::new(x, 0.3 * x, z);
                        let pose = Pose::from_rotation_vector(position_m, DVec3::new(0.0, angle, 0.0));
                        let answer = law.respond(&pose, Demand::Wrench);
                        assert!(answer.force_n.is_finite() && answer.torque_nm.is_finite(), "{pose:?}");
                        let finite_input = x.is_finite() && z.is_finite() && angle.is_finite();
                        assert_eq!(answer.validity == Validity::InvalidInput, !finite_input, "{pose:?}");
                    }
                }
            }
        }
    }
}
