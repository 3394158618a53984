//! Upper plate in the coordinates of the rod.
//!
//! The direction `d` of a section is written in stereographic coordinates `p = tan(angle/2)` towards the horizontal
//! direction of its lean, `d = (2 p, 1 - p²) / (1 + p²)`: no trigonometry, no singularity except for a section turned
//! upside down. The remaining rotation is a turn `psi` about `d`: `R = (shortest turn from the vertical to d) (turn
//! about the vertical by psi)`.

use flotor_hal::glam::{DVec2, DVec3};
use flotor_hal::math;

use crate::pose::{Pose, or_zero};

/// Smallest `1 + d_z`: 177.4 degrees. There is no shortest turn to upside down.
const LEAST_OVERTURN: f64 = 1e-3;

/// Pose of the upper plate, lengths in free lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plate {
    /// Centre relative to home.
    pub(crate) displacement: DVec3,
    /// Stereographic coordinates of the plate's normal.
    pub(crate) lean: DVec2,
    /// Turn about the plate's normal (rad), in -pi..pi.
    pub(crate) turn_rad: f64,
}

flotor_hal::restorable!(Plate { displacement, lean, turn_rad });

impl Plate {
    /// Plate at home.
    pub(crate) const HOME: Self = Self { displacement: DVec3::ZERO, lean: DVec2::ZERO, turn_rad: 0.0 };

    /// Converts a pose; `None` for a plate turned upside down.
    #[inline]
    pub(crate) fn new(pose: &Pose, free_length_m: f64) -> Option<Self> {
        let q = pose.orientation;
        // Twice this is 1 + d_z.
        let upright = q.w * q.w + q.z * q.z;
        if 2.0 * upright < LEAST_OVERTURN {
            return None;
        }
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        Some(Self {
            displacement: (pose.position_m / free_length_m).map(or_zero),
            lean: (DVec2::new(q.x * q.z + q.w * q.y, q.y * q.z - q.w * q.x) / upright).map(or_zero),
            turn_rad: or_zero(2.0 * math::atan2(sign * q.z, sign * q.w)),
        })
    }

    /// Returns the torque, from the derivatives of the energy with respect to lean and turn: minus the derivative with
    /// respect to a small rotation about each axis.
    ///
    /// A rotation `w` changes the turn by `w_z + p.w` and the lean by `c (1 - p²)/2 + p (p.c) + w_z (z x p)`,
    /// `c = (w_y, -w_x)`.
    #[inline]
    pub(crate) fn torque(&self, by_lean: DVec2, by_turn: f64) -> DVec3 {
        let p = self.lean;
        let by_axis = 0.5 * (1.0 - p.length_squared()) * by_lean + by_lean.dot(p) * p;
        DVec3::new(by_axis.y - by_turn * p.x, -by_axis.x - by_turn * p.y, -p.perp_dot(by_lean) - by_turn)
    }

    /// Returns the weighted sum of plates.
    #[inline]
    pub(crate) fn combination<const M: usize>(plates: &[Self; M], weights: &[f64; M]) -> Self {
        let mut sum = Self { displacement: DVec3::ZERO, lean: DVec2::ZERO, turn_rad: 0.0 };
        for (plate, weight) in plates.iter().zip(weights) {
            sum.displacement += *weight * plate.displacement;
            sum.lean += *weight * plate.lean;
            sum.turn_rad += weight * plate.turn_rad;
        }
        sum
    }

    /// Returns the distance between two poses, in free lengths and half radians.
    #[inline]
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        let turn_rad = self.turn_rad - other.turn_rad;
        ((self.displacement - other.displacement).length_squared()
            + (self.lean - other.lean).length_squared()
            + 0.25 * turn_rad * turn_rad)
            .sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::glam::DQuat;

    fn orientations() -> impl Iterator<Item = DQuat> {
        [
            DVec3::new(0.3, -0.5, 0.2),
            DVec3::new(1.5, 1.2, -0.9),
            DVec3::new(-0.1, 0.0, 2.9),
            DVec3::new(2.1, -1.9, 0.4),
        ]
        .into_iter()
        .map(DQuat::from_scaled_axis)
    }

    fn plate(orientation: DQuat) -> Plate {
        Plate::new(&Pose { position_m: DVec3::ZERO, orientation }, 1.0).unwrap()
    }

    #[test]
    fn coordinates_give_the_rotation_back() {
        for orientation in orientations() {
            let Plate { lean, turn_rad, .. } = plate(orientation);
            let shortest = DQuat::from_xyzw(-lean.y, lean.x, 0.0, 1.0).normalize();
            let again = shortest * DQuat::from_rotation_z(turn_rad);
            assert!((again.dot(orientation).abs() - 1.0).abs() < 4e-16);
            assert_eq!(plate(-orientation), plate(orientation));
        }
        assert!(Plate::new(&Pose::from_rotation_vector(DVec3::ZERO, DVec3::X * 3.12), 1.0).is_none());
    }

    #[test]
    fn torque_is_the_derivative_by_rotation() {
        let (by_lean, by_turn, h) = (DVec2::new(0.7, -1.1), 0.4, 1e-4);
        for orientation in orientations() {
            let energy = |rotation: DVec3| {
                let Plate { lean, turn_rad, .. } = plate(DQuat::from_scaled_axis(rotation) * orientation);
                by_lean.dot(lean) + by_turn * turn_rad
            };
            let torque = plate(orientation).torque(by_lean, by_turn);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let pair = |n: f64| energy(axis * (n * h)) - energy(axis * (-n * h));
                let slope = (8.0 * pair(1.0) - pair(2.0)) / (12.0 * h);
                // h⁴ times a derivative of order ten, and rounding over h.
                assert!((slope + torque.dot(axis)).abs() < 1e-10, "{slope} {torque}");
            }
        }
    }
}
