//! Pose of the upper plate, and the geometry common to all laws.
//!
//! Model frame: right-handed, z up, origin at the centre of the upper plate of the unloaded spring; the lower
//! plate is fixed at z = -L0. A rotation turns the upper plate from its rest orientation.

use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::math;

use crate::validity::Validity;
use flotor_lanes::arctangent;
use flotor_lanes::{Real, Vector};

/// Shortest distance between the plates, as a fraction of the free length, at which the chord has a direction. Far below any
/// solid length.
const SHORTEST_CHORD: f64 = 1e-3;

/// Longest distance between the plates, in free lengths. No spring is so long; the limit prevents an overflow in the products
/// of the laws.
const LONGEST_CHORD: f64 = 1e6;

/// Tolerance of the squared norm of the orientation. Rounding causes 1e-15; a larger error is not a rotation.
const UNIT_NORM_TOLERANCE: f64 = 1e-6;

/// Threshold below which a coordinate is set to zero, in m and as a quaternion component: powers of smaller numbers are
/// too small for full precision, and a hundred times slower. A stiffness of 1e10 N/m turns this length into 1e-40 N.
const NEGLIGIBLE: f64 = 1e-50;

/// Pose of the upper plate in the model frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Centre of the upper plate relative to home (m).
    pub position_m: DVec3,
    /// Rotation of the upper plate from rest, unit quaternion.
    pub orientation: DQuat,
}

impl Pose {
    /// Home: the pose without load.
    pub const HOME: Self = Self { position_m: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Builds a pose from a rotation vector (rad; axis times angle). Real-time: bounded, no allocation.
    #[must_use]
    pub fn from_rotation_vector(position_m: DVec3, rotation_rad: DVec3) -> Self {
        Self { position_m, orientation: quaternion(rotation_rad) }
    }

    /// Returns the rotation vector of the orientation (rad), of length 0 to pi. Real-time: bounded, no allocation.
    ///
    /// Accurate to rounding at every angle: neither the arc cosine near zero nor the arc sine near pi is used.
    #[inline]
    #[must_use]
    pub fn rotation_vector_rad(&self) -> DVec3 {
        let Vector { x, y, z } = self.coordinates().rotation_vector_rad();
        DVec3::new(x, y, z)
    }

    /// Returns the straight line from the lower to the upper plate.
    ///
    /// # Errors
    /// [`Validity::InvalidInput`] or [`Validity::OutOfDomain`] if no law can be evaluated at this pose.
    #[inline]
    pub(crate) fn chord(&self, free_length_m: f64) -> Result<Chord, Validity> {
        let Span { vector_m: Vector { x, y, z }, length_m, shortening_m, usable } =
            self.coordinates().span(free_length_m);
        let vector_m = DVec3::new(x, y, z);
        if usable { Ok(Chord { vector_m, length_m, shortening_m }) } else { Err(self.failure_reason()) }
    }

    /// Returns the coordinates of the pose, for formulas over one pose or several.
    #[inline]
    pub(crate) fn coordinates(&self) -> Coordinates<f64> {
        let DVec3 { x, y, z } = self.position_m;
        Coordinates { position_m: Vector { x, y, z }, orientation: self.orientation.to_array() }
    }

    /// Returns the reason for a missing answer: an invalid pose, or a pose outside the domain of the law.
    #[cold]
    pub(crate) fn failure_reason(&self) -> Validity {
        if self.is_valid() { Validity::OutOfDomain } else { Validity::InvalidInput }
    }

    /// Returns true if the pose is valid: finite, with an orientation of unit length. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let norm_error = self.orientation.length_squared() - 1.0;
        self.position_m.is_finite() && norm_error.abs() < UNIT_NORM_TOLERANCE
    }
}

/// Coordinates of a pose, or of one pose per lane.
#[derive(Clone, Copy, Debug)]
pub struct Coordinates<R> {
    /// Centre of the upper plate relative to home (m).
    pub position_m: Vector<R>,
    /// Rotation of the upper plate from rest, unit quaternion `[x, y, z, w]`.
    pub orientation: [R; 4],
}

impl<R: Real> Coordinates<R> {
    /// Returns the pose with negligible coordinates set to zero, see [`NEGLIGIBLE`]. Real-time: bounded, no allocation, no branch.
    #[inline(always)]
    pub(crate) fn without_dust(&self) -> Self {
        let Vector { x, y, z } = self.position_m;
        let [qx, qy, qz, qw] = self.orientation;
        Self {
            position_m: Vector::new(or_zero(x), or_zero(y), or_zero(z)),
            orientation: [or_zero(qx), or_zero(qy), or_zero(qz), qw],
        }
    }

    /// Returns the straight line between the plate centres. Real-time: bounded, no allocation, no branch.
    #[inline(always)]
    pub(crate) fn span(&self, free_length_m: f64) -> Span<R> {
        let Vector { x, y, z } = self.position_m;
        let [qx, qy, qz, qw] = self.orientation;
        let height_m = z + free_length_m;
        // Square of the chord, and the error of the squared norm of the quaternion.
        let aside = x * x + y * y;
        let length_squared = aside + height_m * height_m;
        let norm_error = (qx * qx + qy * qy) + (qz * qz + qw * qw) - 1.0;
        let free_squared = free_length_m * free_length_m;
        // NaN fails each comparison.
        let usable = length_squared.above(SHORTEST_CHORD * SHORTEST_CHORD * free_squared)
            & length_squared.below(LONGEST_CHORD * LONGEST_CHORD * free_squared)
            & norm_error.abs().below(UNIT_NORM_TOLERANCE);
        let length_m = length_squared.sqrt();
        // L0 - L without the cancellation of the difference: (L0² - L²) / (L0 + L).
        let beyond = z * (z + 2.0 * free_length_m) + aside;
        Span {
            vector_m: Vector { x, y, z: height_m },
            length_m,
            shortening_m: -beyond / (length_m + free_length_m),
            usable,
        }
    }

    /// Returns the rotation vector (rad), of length 0 to pi. Real-time: bounded, no allocation, no branch.
    ///
    /// `2 atan(|v| / w) v / |v|` for the quaternion `(v, w)`, by the tangent of half that arc, `|v| / (1 + w)`: no
    /// square root, and nothing to divide by zero at rest.
    #[inline(always)]
    pub(crate) fn rotation_vector_rad(&self) -> Vector<R> {
        let [x, y, z, w] = self.orientation;
        let axis = Vector { x, y, z };
        let sine_squared = axis.dot(axis);
        // The norm, from its square by the tangent at one: the error is of second order in the rounding error.
        let norm = (sine_squared + w * w) * 0.5 + 0.5;
        let inverse = (norm + w.abs()).inverse();
        let scale = arctangent::quotient(sine_squared * (inverse * inverse)) * (inverse * 4.0);
        axis * R::select(w.below(0.0), -scale, scale)
    }
}

/// Straight line between the plate centres, or one in each lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span<R: Real> {
    /// Vector from the lower to the upper plate (m).
    pub(crate) vector_m: Vector<R>,
    /// Distance between the plate centres (m), `L`.
    pub(crate) length_m: R,
    /// `L0 - L` (m), positive in compression.
    pub(crate) shortening_m: R,
    /// Lanes in which a law can be evaluated; in others the numbers are meaningless and may be NaN.
    pub(crate) usable: R::Mask,
}

/// Returns the number, or zero if negligible, see [`NEGLIGIBLE`]. Real-time: bounded, no allocation.
#[inline(always)]
pub(crate) fn or_zero<R: Real>(number: R) -> R {
    R::select(number.abs().below(NEGLIGIBLE), number.like(0.0), number)
}

/// Returns the unit quaternion of a rotation vector.
pub(crate) fn quaternion(rotation_rad: DVec3) -> DQuat {
    let angle = rotation_rad.length();
    let (sine, cosine) = math::sin_cos(0.5 * angle);
    let scale = if angle > 0.0 { sine / angle } else { 0.5 };
    let axis = rotation_rad * scale;
    DQuat::from_xyzw(axis.x, axis.y, axis.z, cosine)
}

/// Straight line between the plate centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chord {
    /// Vector from the lower to the upper plate (m).
    pub(crate) vector_m: DVec3,
    /// Distance between the plate centres (m), `L`.
    pub(crate) length_m: f64,
    /// `L0 - L` (m), positive in compression.
    pub(crate) shortening_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vectors_survive_the_quaternion() {
        let axis = DVec3::new(0.36, -0.48, 0.8);
        for angle in [0.0, 1e-300, 1e-12, 1e-6, 0.01, 0.5, 1.0, 2.0, 3.0, 3.1] {
            let rotation = axis * angle;
            let pose = Pose::from_rotation_vector(DVec3::ZERO, rotation);
            let error = (pose.rotation_vector_rad() - rotation).length();
            // Each conversion rounds to a few units in the last place of the angle.
            assert!(error <= 2e-15 * angle, "{angle}: {error:e}");
            let opposite = Pose { orientation: -pose.orientation, ..pose };
            assert_eq!(
                opposite.rotation_vector_rad(),
                pose.rotation_vector_rad(),
                "q and -q are one rotation"
            );
        }
    }

    #[test]
    fn shortening_keeps_its_digits_near_rest() {
        let free_length_m = 0.025;
        // Straight down by 1 fm: L0 - L computed as a difference would be zero.
        let pose = Pose { position_m: DVec3::new(0.0, 0.0, -1e-18), ..Pose::HOME };
        let chord = pose.chord(free_length_m).unwrap();
        assert!((chord.shortening_m / 1e-18 - 1.0).abs() < 1e-15);
        // A pure shear x lengthens the chord by x²/(2 L0) to leading order.
        let sheared = Pose { position_m: DVec3::new(1e-9, 0.0, 0.0), ..Pose::HOME };
        let lengthening = -sheared.chord(free_length_m).unwrap().shortening_m;
        assert!((lengthening / (1e-18 / (2.0 * free_length_m)) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn unusable_poses_say_why() {
        let verdict = |position_m, orientation| Pose { position_m, orientation }.chord(0.025).err();
        let invalid = Some(Validity::InvalidInput);
        let outside = Some(Validity::OutOfDomain);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(verdict(DVec3::new(0.0, bad, 0.0), DQuat::IDENTITY), invalid);
            assert_eq!(verdict(DVec3::ZERO, DQuat::from_xyzw(0.0, bad, 0.0, 1.0)), invalid);
        }
        assert_eq!(verdict(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0)), invalid);
        assert_eq!(verdict(DVec3::new(0.0, 0.0, -0.025), DQuat::IDENTITY), outside);
        assert_eq!(verdict(DVec3::new(1e9, 0.0, 0.0), DQuat::IDENTITY), outside);
        assert_eq!(verdict(DVec3::splat(1e300), DQuat::IDENTITY), outside);
        assert_eq!(verdict(DVec3::ZERO, DQuat::IDENTITY), None);
    }
}
