//! Poses, twists and wrenches: the plain data that crosses the plugin boundary.
//!
//! Everything is SI and `f64`, in a right-handed frame (device frame: x right, y away from the user, z up). The structs
//! are `#[repr(C)]` arrays of `f64`, so a C plugin sees the same bytes; the methods give [`glam`] types to authors who
//! write Rust. glam itself never crosses the boundary: its minor versions break compatibility.

use crate::abi::layout::layout;
use crate::math;
use glam::{DQuat, DVec3};

layout! {
    Pose { position_m, orientation_xyzw }
    Twist { linear_m_per_s, angular_rad_per_s }
    Wrench { force_n, torque_nm }
}

/// Position and orientation of the handle. 56 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Pose {
    /// Position of the handle, m.
    pub position_m: [f64; 3],
    /// Unit quaternion `[x, y, z, w]`, handle frame to the frame the pose is given in.
    pub orientation_xyzw: [f64; 4],
}

impl Pose {
    /// The home pose: no displacement, no rotation.
    pub const HOME: Pose = Pose { position_m: [0.0; 3], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] };

    /// Builds a pose from glam values. Real-time: bounded, no allocation.
    #[inline]
    pub fn new(position_m: DVec3, orientation: DQuat) -> Self {
        Self { position_m: position_m.to_array(), orientation_xyzw: orientation.to_array() }
    }

    /// Returns the position, m. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn position(&self) -> DVec3 {
        DVec3::from_array(self.position_m)
    }

    /// Returns the orientation as a unit quaternion. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn orientation(&self) -> DQuat {
        DQuat::from_array(self.orientation_xyzw)
    }

    /// Returns true if every number is finite. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        non_finite_bits(&self.position_m) | non_finite_bits(&self.orientation_xyzw) == 0
    }
}

/// Linear and angular velocity of the handle. 48 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Twist {
    /// Linear velocity of the handle, m/s.
    pub linear_m_per_s: [f64; 3],
    /// Angular velocity, rad/s.
    pub angular_rad_per_s: [f64; 3],
}

impl Twist {
    /// No motion.
    pub const ZERO: Twist = Twist { linear_m_per_s: [0.0; 3], angular_rad_per_s: [0.0; 3] };

    /// Builds a twist from glam values. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn new(linear_m_per_s: DVec3, angular_rad_per_s: DVec3) -> Self {
        Self { linear_m_per_s: linear_m_per_s.to_array(), angular_rad_per_s: angular_rad_per_s.to_array() }
    }

    /// Returns the linear velocity, m/s. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn linear(&self) -> DVec3 {
        DVec3::from_array(self.linear_m_per_s)
    }

    /// Returns the angular velocity, rad/s. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn angular(&self) -> DVec3 {
        DVec3::from_array(self.angular_rad_per_s)
    }

    /// Returns true if every number is finite. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        non_finite_bits(&self.linear_m_per_s) | non_finite_bits(&self.angular_rad_per_s) == 0
    }
}

/// Force and torque **on the hand**, at the handle. 48 bytes.
///
/// A compressed spring pushes the hand up: positive compression, positive z force.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Wrench {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque, N·m.
    pub torque_nm: [f64; 3],
}

impl Wrench {
    /// No force, no torque.
    pub const ZERO: Wrench = Wrench { force_n: [0.0; 3], torque_nm: [0.0; 3] };

    /// Builds a wrench from glam values. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn new(force_n: DVec3, torque_nm: DVec3) -> Self {
        Self { force_n: force_n.to_array(), torque_nm: torque_nm.to_array() }
    }

    /// Builds a wrench from a force, N, without torque. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn from_force(force_n: DVec3) -> Self {
        Self::new(force_n, DVec3::ZERO)
    }

    /// Returns the force, N. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn force(&self) -> DVec3 {
        DVec3::from_array(self.force_n)
    }

    /// Returns the torque, N·m. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn torque(&self) -> DVec3 {
        DVec3::from_array(self.torque_nm)
    }

    /// Returns true if every number is finite. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        non_finite_bits(&self.force_n) | non_finite_bits(&self.torque_nm) == 0
    }
}

impl std::ops::Add for Wrench {
    type Output = Wrench;
    #[inline]
    fn add(self, other: Wrench) -> Wrench {
        Wrench::new(self.force() + other.force(), self.torque() + other.torque())
    }
}

impl std::ops::Sub for Wrench {
    type Output = Wrench;
    #[inline]
    fn sub(self, other: Wrench) -> Wrench {
        Wrench::new(self.force() - other.force(), self.torque() - other.torque())
    }
}

impl std::ops::Mul<f64> for Wrench {
    type Output = Wrench;
    #[inline]
    fn mul(self, factor: f64) -> Wrench {
        Wrench::new(self.force() * factor, self.torque() * factor)
    }
}

/// Returns the rotation vector (axis times angle, rad, angle in 0..=pi) of a unit quaternion: its logarithm.
///
/// Exact to rounding near the identity, where `acos` would lose half the digits.
/// Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn rotation_vector(orientation: DQuat) -> DVec3 {
    // q and -q are one rotation; taking w >= 0 keeps the angle in 0..=pi.
    let sign = if orientation.w < 0.0 { -1.0 } else { 1.0 };
    let axis_sin_half = orientation.xyz() * sign;
    let cos_half = orientation.w * sign;
    let sin_half = axis_sin_half.length();
    // 2 atan2(s, c) / s -> 2 / c as s -> 0; below 1e-8 the next term s^2 / 3 is under one rounding.
    let factor =
        if sin_half < 1.0e-8 { 2.0 / cos_half } else { 2.0 * math::atan2(sin_half, cos_half) / sin_half };
    axis_sin_half * factor
}

/// Returns the unit quaternion of a rotation vector (axis times angle, rad): the exponential.
///
/// Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn orientation_from_rotation_vector(rotation_rad: DVec3) -> DQuat {
    let angle_rad = rotation_rad.length();
    // sin(a / 2) / a -> 1 / 2; below 1e-8 the next term a^2 / 48 is under one rounding.
    let factor = if angle_rad < 1.0e-8 { 0.5 } else { math::sin(0.5 * angle_rad) / angle_rad };
    let xyz = rotation_rad * factor;
    DQuat::from_xyzw(xyz.x, xyz.y, xyz.z, math::cos(0.5 * angle_rad))
}

/// Returns 0 if every number is finite: `value - value` is 0 in all bits for a finite value, and NaN otherwise.
/// Compiles to a few vector instructions without branches.
#[inline]
#[allow(clippy::eq_op)] // NaN for values that are not finite
fn non_finite_bits<const N: usize>(values: &[f64; N]) -> u64 {
    values.iter().fold(0, |bits, value| bits | (value - value).to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_inverts_exponential_from_denormal_to_pi() {
        let axis = DVec3::new(0.36, -0.48, 0.8);
        for exponent in -300..=0 {
            let angle = 3.0 * 10.0_f64.powi(exponent);
            let back = rotation_vector(orientation_from_rotation_vector(axis * angle));
            // Four roundings (sin, divide, atan2, multiply) of a number the size of the angle.
            assert!((back - axis * angle).length() <= 8.0 * f64::EPSILON * angle, "{angle}: {back}");
        }
    }

    #[test]
    fn both_quaternions_of_a_rotation_have_one_rotation_vector() {
        let q = orientation_from_rotation_vector(DVec3::new(0.1, 0.2, -0.3));
        assert_eq!(rotation_vector(q), rotation_vector(-q));
    }

    #[test]
    fn quaternion_order_is_x_y_z_w_as_the_contract_says() {
        let quarter_turn_about_z = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let pose = Pose::new(DVec3::ZERO, quarter_turn_about_z);
        assert!(pose.orientation_xyzw[2] > 0.7 && pose.orientation_xyzw[3] > 0.7);
        assert!((pose.orientation() * DVec3::X - DVec3::Y).length() < 1.0e-15);
    }

    #[test]
    fn a_single_nan_is_seen() {
        let mut wrench = Wrench::ZERO;
        assert!(wrench.is_finite());
        wrench.torque_nm[2] = f64::NAN;
        assert!(!wrench.is_finite());
    }
}
