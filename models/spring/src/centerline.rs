//! Shape of the spring between its plates, for drawing.
//!
//! The thesis draws the coil around the bent axis of its beam-column (equations 37 and 61), with an end slope that does
//! not match the drawn plates. Here the axis is the same linear beam-column in the form per current length (as in
//! [`crate::energy`]), in space instead of in two planes, and exact at its ends: the first section has position and
//! orientation of the lower plate and the last section those of the upper plate, at every pose. Between the plates the axis
//! is the exact rod's shape to first order in the angles, see [`crate::shape`]. Close to buckling the shape saturates, like
//! the bending energy.

use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::math;

use crate::pose::{Pose, quaternion};
use crate::rigidity::{Geometry, Spring};
use crate::shape::{Shape, saturated_argument};
use flotor_lanes::entire::EntireFunctions;

/// Coil wound around the centerline, for drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Helix {
    /// Distance from the centerline to the centre of the wire (m), `D / 2`.
    pub coil_radius_m: f64,
    /// Radius of the wire (m), `d / 2`.
    pub wire_radius_m: f64,
    /// Number of turns from plate to plate, `n`; a fraction `s` of the centerline has `n s` turns.
    pub turns: f64,
}

impl Helix {
    /// Returns the coil of a spring.
    #[must_use]
    pub fn new(geometry: &Geometry) -> Self {
        Self {
            coil_radius_m: 0.5 * geometry.coil_diameter_m,
            wire_radius_m: 0.5 * geometry.wire_diameter_m,
            turns: geometry.active_coils,
        }
    }
}

/// Cross-section of the rod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Centre, in the model frame (m).
    pub center_m: DVec3,
    /// Rotation from rest; its z axis is the normal of the section.
    pub orientation: DQuat,
}

/// Bent axis of a spring at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centerline {
    lower_plate_m: DVec3,
    chord_m: DVec3,
    direction: DVec3,
    /// Shortest rotation from upright to the chord.
    upright_to_chord: DQuat,
    /// Half sum and half difference of the lean of the end normals (rad), vectors across the chord.
    sway_rad: DVec3,
    bow_rad: DVec3,
    twist_rad: f64,
    shape: Shape,
}

impl Centerline {
    /// Computes the bent axis at a pose; `None` if the model has no wrench at the pose (see [`EnergyForm::respond`]) or the
    /// normal of a plate is opposite to the chord. Not real-time.
    ///
    /// [`EnergyForm::respond`]: crate::energy::EnergyForm::respond
    #[must_use]
    pub fn new(spring: &Spring, pose: &Pose) -> Option<Self> {
        let free_length_m = spring.geometry().free_length_m;
        let chord = pose.chord(free_length_m).ok()?;
        let orientation = pose.orientation.normalize();
        let direction = chord.vector_m / chord.length_m;
        let lower_lean = lean(direction, DVec3::Z)?;
        let upper_lean = lean(direction, orientation * DVec3::Z)?;
        let upright_to_chord = quaternion(direction.cross(lower_lean)).conjugate();
        // The remaining rotation of the upper plate is about the axis.
        let rest = (quaternion(direction.cross(upper_lean)) * upright_to_chord).conjugate() * orientation;
        // Limit the argument short of the pole, and of tension so strong that all bending is at the ends.
        let argument = Shape::argument(spring.rigidities(), free_length_m, chord.length_m)?;
        let argument = saturated_argument(argument).value.max(EntireFunctions::MIN_ARGUMENT);
        Some(Self {
            lower_plate_m: DVec3::new(0.0, 0.0, -free_length_m),
            chord_m: chord.vector_m,
            direction,
            upright_to_chord,
            sway_rad: 0.5 * (upper_lean + lower_lean),
            bow_rad: 0.5 * (upper_lean - lower_lean),
            twist_rad: 2.0 * math::atan2(rest.z * rest.w.signum(), rest.w.abs()),
            shape: Shape::new(spring.rigidities(), free_length_m, chord.length_m, argument)?,
        })
    }

    /// Returns the section at the fraction `s` of the coils, 0 at the lower plate and 1 at the upper plate; other values are
    /// clamped, and NaN counts as 0. Not real-time.
    #[must_use]
    pub fn section(&self, s: f64) -> Section {
        #[allow(clippy::manual_clamp)] // clamp would let NaN through
        let s = s.max(0.0).min(1.0);
        // Lean and offset of equations 17 and 18 of the thesis, weighted by the sway and the bow of the ends.
        let [sway, bow] = self.shape.lean(s - 0.5).map(|lean| lean.value);
        let lean = self.sway_rad * sway + self.bow_rad * bow;
        let [sway, bow] = self.shape.offset(s - 0.5);
        let offset_m = (self.sway_rad * sway + self.bow_rad * bow) * self.chord_m.length();
        Section {
            center_m: self.lower_plate_m + self.chord_m * s + offset_m,
            orientation: quaternion(self.direction.cross(lean))
                * self.upright_to_chord
                * DQuat::from_rotation_z(self.twist_rad * s),
        }
    }
}

/// Returns the rotation along the great circle from `from` to `to`, as a vector across `from` (rad); `None` for opposite directions.
fn lean(from: DVec3, to: DVec3) -> Option<DVec3> {
    let (cosine, across) = (from.dot(to), to - from.dot(to) * from);
    let sine = across.length();
    if sine > 0.0 {
        Some(across * (math::atan2(sine, cosine) / sine))
    } else {
        (cosine > 0.0).then_some(DVec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    /// Every mix of compression, shear, tilt and yaw of the workspace and well beyond it.
    fn poses(free_length_m: f64) -> Vec<Pose> {
        let mut poses = Vec::new();
        for height in [-0.7, -0.5, -0.2, 0.0, 0.2, 0.8] {
            for shear in [0.0, 0.1, -0.4] {
                for tilt in [0.0, 0.1, -0.6] {
                    for yaw in [0.0, -0.2, 1.5] {
                        poses.push(Pose::from_rotation_vector(
                            DVec3::new(shear, -0.3 * shear, height) * free_length_m,
                            DVec3::new(0.4 * tilt, tilt, yaw),
                        ));
                    }
                }
            }
        }
        poses
    }

    fn angle_between(a: DQuat, b: DQuat) -> f64 {
        let rotation = a.conjugate() * b;
        2.0 * DVec3::new(rotation.x, rotation.y, rotation.z).length()
    }

    #[test]
    fn ends_lie_in_the_plates() {
        for preset in Preset::ALL {
            let spring = preset.spring();
            let free_length_m = spring.geometry().free_length_m;
            for pose in poses(free_length_m) {
                let line = Centerline::new(&spring, &pose).unwrap();
                let (lower, upper) = (line.section(0.0), line.section(1.0));
                let lower_plate = DVec3::new(0.0, 0.0, -free_length_m);
                // Rounding, enlarged by the inverse of G0 >= 0.033 close to the pole.
                assert!(
                    (lower.center_m - lower_plate).length() < 1e-13 * free_length_m,
                    "{preset:?} {pose:?}"
                );
                assert!(
                    (upper.center_m - pose.position_m).length() < 1e-13 * free_length_m,
                    "{preset:?} {pose:?}"
                );
                assert!(angle_between(lower.orientation, DQuat::IDENTITY) < 1e-13, "{preset:?} {pose:?}");
                assert!(angle_between(upper.orientation, pose.orientation) < 1e-13, "{preset:?} {pose:?}");
            }
        }
    }

    #[test]
    fn unloaded_spring_is_straight_and_even() {
        let spring = Preset::Thesis1.spring();
        let line = Centerline::new(&spring, &Pose::HOME).unwrap();
        for s in [0.0, 0.25, 0.5, 1.0] {
            let section = line.section(s);
            assert_eq!(section.center_m, DVec3::new(0.0, 0.0, 0.025 * s - 0.025));
            assert_eq!(section.orientation, DQuat::IDENTITY);
        }
        assert_eq!(line.section(f64::NAN), line.section(0.0));
        assert_eq!(line.section(7.0), line.section(1.0));
    }

    #[test]
    fn poses_without_an_answer_have_no_shape() {
        let spring = Preset::Thesis1.spring();
        let at = |z| Centerline::new(&spring, &Pose { position_m: DVec3::new(0.0, 0.0, z), ..Pose::HOME });
        assert!(at(-0.025).is_none(), "plates in one point");
        assert!(at(-0.050).is_none(), "lower plate faces away from the chord");
        assert!(at(f64::NAN).is_none());
        assert!(at(-0.024).is_some());
    }
}
