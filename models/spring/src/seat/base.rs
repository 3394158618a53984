//! Base of a spring on the ground: its place, and the spring relative to the base.

use flotor_hal::glam::{DQuat, DVec2, DVec3};
use flotor_hal::math;

use crate::held::HeldSpring;
use crate::pose::{Pose, quaternion};
use crate::response::{Demand, Response};
use crate::rigidity::Spring;

/// Lengths of the spring that its base depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lengths {
    pub(super) rim_radius_m: f64,
    pub(super) free_length_m: f64,
}

impl Lengths {
    pub(super) fn of(spring: &Spring) -> Self {
        let geometry = spring.geometry();
        Self { rim_radius_m: 0.5 * geometry.coil_diameter_m, free_length_m: geometry.free_length_m }
    }

    /// Returns the vector from the centre of the base to the centre of the upper plate, without load.
    pub(super) fn rise_m(&self) -> DVec3 {
        DVec3::Z * self.free_length_m
    }
}

/// Place of a base: tilt (rad) towards the rim point of contact, slide (m), and turn about its normal (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Standing {
    pub(super) tilt_rad: DVec2,
    pub(super) slide_m: DVec2,
    pub(super) turn_rad: f64,
}

flotor_hal::restorable!(Standing { tilt_rad, slide_m, turn_rad });

impl Standing {
    /// Flat, at the initial place.
    pub(super) const SEATED: Self = Self { tilt_rad: DVec2::ZERO, slide_m: DVec2::ZERO, turn_rad: 0.0 };

    /// Returns the base of a spring that hangs from the upper plate, and the height of its rim above the ground (m).
    pub(super) fn hanging(pose: &Pose, lengths: &Lengths, largest_tilt_rad: f64) -> (Self, f64) {
        let normal = pose.orientation * DVec3::Z;
        let center_m = pose.position_m + lengths.rise_m() - normal * lengths.free_length_m;
        let sine = normal.truncate().length();
        let lean = if sine > 0.0 { normal.truncate() / sine } else { DVec2::ZERO };
        let standing = Self {
            tilt_rad: lean * math::atan2(sine, normal.z).min(largest_tilt_rad),
            // The rim point of contact is the same as for a base that had rolled there.
            slide_m: center_m.truncate() - lean * (lengths.rim_radius_m * (1.0 - normal.z)),
            turn_rad: 2.0 * math::atan2(pose.orientation.z, pose.orientation.w),
        };
        (standing, center_m.z - lengths.rim_radius_m * sine)
    }

    /// Interpolates linearly towards another place.
    pub(super) fn toward(&self, there: &Self, part: f64) -> Self {
        Self {
            tilt_rad: self.tilt_rad.lerp(there.tilt_rad, part),
            slide_m: self.slide_m.lerp(there.slide_m, part),
            turn_rad: self.turn_rad + part * (there.turn_rad - self.turn_rad),
        }
    }
}

/// Pose of a base.
pub(super) struct Base {
    /// Direction of the tilt, towards the rim point of contact.
    pub(super) direction: DVec2,
    pub(super) angle_rad: f64,
    pub(super) rotation: DQuat,
    /// Position of the base's centre relative to its initial position.
    pub(super) center_m: DVec3,
    lengths: Lengths,
    is_seated: bool,
}

impl Base {
    pub(super) fn new(at: &Standing, lengths: &Lengths) -> Self {
        let angle_rad = at.tilt_rad.length();
        let direction = if angle_rad > 0.0 { at.tilt_rad / angle_rad } else { DVec2::ZERO };
        let (sine, cosine) = math::sin_cos(angle_rad);
        let rolled_m = lengths.rim_radius_m * (direction * (1.0 - cosine)).extend(sine);
        Self {
            direction,
            angle_rad,
            rotation: quaternion(at.tilt_rad.perp().extend(0.0)) * DQuat::from_rotation_z(at.turn_rad),
            center_m: rolled_m + at.slide_m.extend(0.0),
            lengths: *lengths,
            is_seated: *at == Standing::SEATED,
        }
    }

    /// Returns a pose relative to the base.
    pub(super) fn relative(&self, pose: &Pose) -> Pose {
        let (rise_m, back) = (self.lengths.rise_m(), self.rotation.conjugate());
        Pose {
            position_m: back * (pose.position_m + rise_m - self.center_m) - rise_m,
            orientation: back * pose.orientation,
        }
    }

    /// Returns the law's response on this base, in the model frame. Real-time: bounded, no allocation.
    pub(super) fn respond(&self, spring: &mut dyn HeldSpring, pose: &Pose, demand: Demand) -> Response {
        self.answer(pose, |relative| spring.respond(relative, demand))
    }

    /// Evaluates a response at the pose relative to the base, and converts it to the model frame. Real-time: bounded, no allocation.
    pub(super) fn answer(&self, pose: &Pose, at: impl FnOnce(&Pose) -> Response) -> Response {
        if self.is_seated {
            return at(pose);
        }
        let response = at(&self.relative(pose));
        Response {
            force_n: self.rotation * response.force_n,
            torque_nm: self.rotation * response.torque_nm,
            ..response
        }
    }

    /// Returns the moment of the spring on its base, about the base's centre.
    fn moment_nm(&self, pose: &Pose, response: &Response) -> DVec3 {
        let arm_m = pose.position_m + self.lengths.rise_m() - self.center_m;
        -(response.torque_nm + arm_m.cross(response.force_n))
    }

    /// Returns the pull of the spring on its base: the force along the ground, and the torque about the base's normal over the radius (N).
    pub(super) fn pull_n(&self, pose: &Pose, response: &Response) -> DVec3 {
        let turning_nm = self.moment_nm(pose, response).dot(self.rotation * DVec3::Z);
        (-response.force_n.truncate()).extend(turning_nm / self.lengths.rim_radius_m)
    }

    /// Returns the derivative of the stored energy with respect to the tilt: minus the work of the spring on the moving base.
    pub(super) fn slope(&self, pose: &Pose, response: &Response) -> DVec2 {
        let force_n = response.force_n;
        let moment_nm = self.moment_nm(pose, response);
        if self.angle_rad == 0.0 {
            // Along u the base turns about z x u and rises by R; the second part is the tip's.
            return DVec2::new(-moment_nm.y, moment_nm.x);
        }
        let along = self.direction.extend(0.0);
        let across = DVec3::new(-along.y, along.x, 0.0);
        let (sine, cosine) = math::sin_cos(self.angle_rad);
        let (chord, versine) = (sine / self.angle_rad, (1.0 - cosine) / self.angle_rad);
        let radius_m = self.lengths.rim_radius_m;
        let by_angle = radius_m * (sine * force_n.dot(along) + cosine * force_n.z) - moment_nm.dot(across);
        // Turning the rim point: the base turns about -u, and about z where it is tilted.
        let by_side =
            radius_m * versine * force_n.dot(across) + chord * moment_nm.dot(along) - versine * moment_nm.z;
        by_angle * self.direction + by_side * self.direction.perp()
    }
}
