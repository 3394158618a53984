//! Range of motion and force limits of the magnetic-levitation haptic device: published numbers, as constants.
//!
//! Source throughout: Varadharajan 2007 (CMU-RI-TR-07-21), section 2, unless a constant says otherwise.

use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::math;

/// Largest distance from the origin within the range of the sensors, in all directions, m (thesis section 2: ±12 mm).
pub const TRANSLATION_RANGE_M: f64 = 12.0e-3;

/// Largest rotation within the range of the sensors, about all axes, rad (thesis section 2: ±7 degrees).
pub const ROTATION_RANGE_RAD: f64 = 7.0 * std::f64::consts::PI / 180.0;

/// Largest force along each axis, N. The thesis (section 2) gives 55 to 140 N "depending on the axis", without the
/// axes; the vertical is assumed to be the strong axis, as in any six-coil bowl that meets both numbers.
pub const FORCE_LIMIT_N: DVec3 = DVec3::new(55.0, 55.0, 140.0);

/// Largest torque about each axis, N·m. The thesis (section 2) gives 6.3 to 12.2 N·m; yaw is assumed to be the strong
/// axis.
pub const TORQUE_LIMIT_NM: DVec3 = DVec3::new(6.3, 6.3, 12.2);

/// Largest stiffness of a rendered contact in translation, N/m (thesis section 2: about 25 N/mm).
pub const STIFFNESS_LIMIT_N_PER_M: f64 = 25.0e3;

/// Pose of the flotor relative to the range of the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorRange {
    /// Translation and rotation are within the range of the sensors.
    Inside,
    /// The flotor is out of range, or the pose is not finite: the pose is invalid.
    Outside,
}

impl SensorRange {
    /// Classifies a pose: `position_m` of the flotor frame's origin and `orientation` (unit, flotor to device frame), both
    /// in the device frame. A non-finite pose is outside.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn of(position_m: DVec3, orientation: DQuat) -> Self {
        // |w| is the cosine of half the angle: comparing cosines needs no arc cosine. NaN fails both
        // comparisons.
        let within_translation = position_m.length_squared() <= TRANSLATION_RANGE_M * TRANSLATION_RANGE_M;
        let within_rotation = orientation.w.abs() >= math::cos(0.5 * ROTATION_RANGE_RAD);
        if within_translation && within_rotation { Self::Inside } else { Self::Outside }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_ends_at_twelve_millimetres_and_seven_degrees_in_every_direction() {
        for direction in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.36, -0.48, 0.8)] {
            for (scale, expected) in [(0.999, SensorRange::Inside), (1.001, SensorRange::Outside)] {
                let shifted = direction * (TRANSLATION_RANGE_M * scale);
                let turned = DQuat::from_axis_angle(direction, ROTATION_RANGE_RAD * scale);
                assert_eq!(SensorRange::of(shifted, DQuat::IDENTITY), expected);
                assert_eq!(SensorRange::of(DVec3::ZERO, turned), expected);
                assert_eq!(SensorRange::of(DVec3::ZERO, -turned), expected, "q and -q are one rotation");
            }
        }
    }

    #[test]
    fn a_pose_that_is_not_finite_is_outside() {
        assert_eq!(SensorRange::of(DVec3::NAN, DQuat::IDENTITY), SensorRange::Outside);
        assert_eq!(SensorRange::of(DVec3::ZERO, DQuat::NAN), SensorRange::Outside);
    }
}
