//! Variants `closed-form` and `current-length`: the thesis's closed form without its branches.
//!
//! The thesis solves the linear beam-column in the two vertical planes separately, adds the axial force, and
//! turns each planar result from the chord back to the plates, first in one plane and then in the other
//! (section 3.2, appendix A). Its code switches formulas at the free length, returns NaN at rest and jumps at a
//! buckling point that is not there. [`ClosedForm`] evaluates the same law through entire functions: one smooth
//! expression for compression, rest and elongation.
//!
//! [`Form::Printed`] keeps what the source does, right or wrong: rigidities per unloaded length and the sum
//! `M_U + M_L` as the torque on the hand. It is there for comparison; it creates energy on closed paths.
//! [`Form::CurrentLength`] corrects these two and is the exact linearisation of the rod in each plane. Both
//! keep the two successive rotations, so neither is conservative in space: that is what
//! [`energy`](crate::energy) is for.
//!
//! In the source's letters X, Z are horizontal and Y is vertical; here x = X, y = Z, z = Y. Its tilt angles
//! enter as `psi_Uz = psi_Lz - ry` and `psi_Ux = psi_Lx + rx` with the right-handed rotation vector (rx, ry, rz).

use std::f64::consts::PI;

use flotor_hal::glam::DVec3;

use crate::beam_column::EndStiffness;
use crate::pose::{Chord, Pose};
use crate::response::{Demand, Response};
use crate::rigidity::{Rigidities, Spring};
use crate::validity::Validity;

/// Which closed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// As printed (variant `closed-form`).
    Printed,
    /// Rigidities scaled by `L / L0`, torque `M_U` (variant `current-length`).
    CurrentLength,
}

/// The closed-form law of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosedForm {
    form: Form,
    rigidities: Rigidities,
    free_length_m: f64,
    axial_n_per_m: f64,
    yaw_nm_per_rad: f64,
}

impl ClosedForm {
    /// Prepares the law. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(spring: &Spring, form: Form) -> Self {
        let rigidities = *spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        Self {
            form,
            rigidities,
            free_length_m,
            axial_n_per_m: rigidities.gamma_n / free_length_m,
            yaw_nm_per_rad: rigidities.tau_n_m2 / free_length_m,
        }
    }

    /// Wrench on the hand at a pose; this law has no energy. Real-time: bounded, no allocation.
    ///
    /// Total over all poses:
    /// - past the solid length the law goes on, it knows no coil contact;
    /// - upper plate not above the lower one, or beyond the first pole of the bow (`q L >= 2 pi`, where a real
    ///   spring has buckled): the formulas are continued, [`Validity::Clamped`];
    /// - exactly at a pole, plates closer than a thousandth or farther than a million free lengths: no wrench,
    ///   [`Validity::OutOfDomain`];
    /// - NaN, infinity or a quaternion that is not of unit length: no wrench, [`Validity::InvalidInput`].
    #[must_use]
    pub fn respond(&self, pose: &Pose, demand: Demand) -> Response {
        match pose.chord(self.free_length_m) {
            Ok(chord) => self.respond_along(&chord, pose.rotation_vector_rad(), demand).if_finite(),
            Err(validity) => Response::none(validity),
        }
    }

    #[inline]
    fn respond_along(&self, chord: &Chord, rotation_rad: DVec3, demand: Demand) -> Response {
        let axial_force_n = self.axial_n_per_m * chord.shortening_m;
        let column = match self.form {
            Form::Printed => EndStiffness::printed(&self.rigidities, axial_force_n, chord.length_m),
            Form::CurrentLength => EndStiffness::current_length(
                &self.rigidities,
                axial_force_n,
                chord.length_m,
                self.free_length_m,
            ),
        };
        let DVec3 { x, y, z: height_m } = chord.vector_m;
        let planes = [Plane::new(x, height_m, -rotation_rad.y), Plane::new(y, height_m, rotation_rad.x)];
        let shear_n = planes.map(|plane| -column.sway_n_per_rad * plane.end_angle_sum_rad);
        let [about_y, about_x] = &planes;

        // Chord to plates: about one axis, then about the other, as printed.
        let (force_x, upright) = about_y.turn(shear_n[0], axial_force_n);
        let (force_y, force_z) = about_x.turn(shear_n[1], upright);

        let torque_nm = if demand >= Demand::Wrench {
            let [moment_y, moment_x] = [0, 1].map(|i| self.moment_on_hand_nm(&column, chord, &planes[i]));
            DVec3::new(-moment_x, moment_y, -self.yaw_nm_per_rad * rotation_rad.z)
        } else {
            DVec3::ZERO
        };
        let within = height_m > 0.0 && column.argument < PI * PI;
        Response {
            force_n: DVec3::new(force_x, force_y, force_z),
            torque_nm,
            energy_j: None,
            validity: if within { Validity::Ok } else { Validity::Clamped },
        }
    }

    /// `M_U + M_L = (a - b) (psi_U - psi_L)` as printed, or `M_U = a psi_U + b psi_L`.
    #[inline]
    fn moment_on_hand_nm(&self, column: &EndStiffness, chord: &Chord, plane: &Plane) -> f64 {
        let bow_nm = column.bow_nm_per_rad * plane.tilt_rad;
        match self.form {
            Form::Printed => bow_nm,
            Form::CurrentLength => {
                let sway_nm = column.sway_n_per_rad * chord.length_m * plane.end_angle_sum_rad;
                0.5 * (sway_nm + bow_nm)
            }
        }
    }
}

/// One vertical plane: the chord's projection and the ends of the rod seen in it.
#[derive(Clone, Copy)]
struct Plane {
    /// Sine of the chord's inclination `psi_L`.
    sine: f64,
    /// Cosine of it.
    cosine: f64,
    /// `psi_U - psi_L` (rad): minus the tilt of the upper plate towards the positive side.
    tilt_rad: f64,
    /// `psi_U + psi_L` (rad).
    end_angle_sum_rad: f64,
}

impl Plane {
    #[inline]
    fn new(sideways_m: f64, height_m: f64, tilt_rad: f64) -> Self {
        let length_squared = sideways_m * sideways_m + height_m * height_m;
        // A chord square to the plane has no inclination in it: call it upright.
        let (sine, cosine, inclination_rad) = if length_squared > 0.0 {
            let inverse = 1.0 / length_squared.sqrt();
            (sideways_m * inverse, height_m * inverse, sideways_m.atan2(height_m))
        } else {
            (0.0, 1.0, 0.0)
        };
        Self { sine, cosine, tilt_rad, end_angle_sum_rad: 2.0 * inclination_rad + tilt_rad }
    }

    /// Components across and along the chord to horizontal and vertical.
    #[inline]
    fn turn(&self, across: f64, along: f64) -> (f64, f64) {
        (across * self.cosine + along * self.sine, along * self.cosine - across * self.sine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

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
                assert!((force_n.z - hooke_n).abs() <= 4e-16 * hooke_n.abs());
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
