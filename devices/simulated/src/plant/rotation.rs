//! Rotation of a rigid body: Euler's equations in the body's own frame and the kinematics of its quaternion.

use flotor_hal::glam::{DMat3, DQuat, DVec3};

/// Returns the angular acceleration in the body frame, rad/s², from Euler's equations `I w' = T - w x I w`.
///
/// Real-time: bounded, no allocation.
#[inline]
pub(super) fn angular_acceleration(
    inertia_kg_m2: &DMat3,
    inverse_inertia: &DMat3,
    spin_rad_per_s: DVec3,
    torque_nm: DVec3,
) -> DVec3 {
    *inverse_inertia * (torque_nm - spin_rad_per_s.cross(*inertia_kg_m2 * spin_rad_per_s))
}

/// Returns the rate of the orientation (body to device frame) for an angular velocity in the body frame: `q' = q w / 2`.
///
/// Real-time: bounded, no allocation.
#[inline]
pub(super) fn quaternion_rate(orientation: DQuat, spin_rad_per_s: DVec3) -> DQuat {
    // Product with a pure quaternion, without the zero terms.
    let half = spin_rad_per_s * 0.5;
    let axis = orientation.xyz();
    let vector = half * orientation.w + axis.cross(half);
    DQuat::from_xyzw(vector.x, vector.y, vector.z, -axis.dot(half))
}

/// Returns the small rotation from `orientation` to `target` in the body frame, rad: `2 sin(angle / 2)` about the common
/// axis.
///
/// The result differs from the rotation vector by less than a thousandth over ±7 degrees, needs no arc function, is smooth
/// up to half a turn, and a torque proportional to it has a potential (`4 k (1 - cos(angle / 2))`). Real-time: bounded, no
/// allocation.
#[inline]
pub(super) fn misalignment_rad(orientation: DQuat, target: DQuat) -> DVec3 {
    // Vector part of `orientation* target`; q and -q are one rotation: take the shorter way.
    let (from, to) = (orientation.xyz(), target.xyz());
    let sine = to * orientation.w - from * target.w - from.cross(to);
    sine * 2.0_f64.copysign(orientation.dot(target))
}

/// Returns the inertia of a unit point mass at `position_m` about the origin, m². Real-time: bounded, no allocation.
pub(super) fn point_inertia(position_m: DVec3) -> DMat3 {
    let outer =
        DMat3::from_cols(position_m * position_m.x, position_m * position_m.y, position_m * position_m.z);
    DMat3::from_diagonal(DVec3::splat(position_m.length_squared())) - outer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misalignment_is_the_rotation_vector_for_small_angles_whatever_the_sign_of_the_quaternion() {
        let start = DQuat::from_scaled_axis(DVec3::new(0.3, -0.2, 0.5));
        let turn = DVec3::new(0.02, -0.05, 0.03);
        let end = start * DQuat::from_scaled_axis(turn);
        for target in [end, -end] {
            // 2 sin(a/2) = a (1 - a^2/24 + ...), a = 0.062.
            assert!((misalignment_rad(start, target) - turn).length() < turn.length().powi(3) / 24.0);
        }
    }

    #[test]
    fn a_point_mass_resists_rotation_across_its_arm_only() {
        let arm_m = DVec3::new(0.01, -0.02, 0.03);
        let inertia = point_inertia(arm_m);
        assert!((inertia * arm_m).length() < 1.0e-18, "along the arm: nothing but rounding of 1e-5");
        let across = arm_m.cross(DVec3::X);
        assert!((inertia * across - across * arm_m.length_squared()).length() < 1.0e-18);
    }
}
