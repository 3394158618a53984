//! Poses of the tests: evenly through the workspace, and on the sets of measure zero where formulas break.
//!
//! Even coverage is [Sobol's sequence](crate::sampling): any first part of it covers the space evenly, so a short run takes the
//! first poses of a full run. No sequence ever hits home exactly, or a coordinate plane, or a non-finite number: those are the
//! named [`MANIFOLDS`].

use crate::sampling::{Random, Sobol};
use crate::trajectory::at;
use flotor_hal::{DQuat, DVec3, Pose, Twist, math, rotation_vector};
use serde::Serialize;
use std::f64::consts::PI;

/// Workspace of the handle around home, in the model frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reach {
    /// Limit along each axis, m.
    pub position_m: f64,
    /// Limit of each component of the rotation vector, rad.
    pub rotation_rad: f64,
}

impl Default for Reach {
    /// Returns the range of the thesis's device (section 2.1), 12 mm and 7 degrees, with the position scaled by L0/V = 25/15 to
    /// 20 mm.
    fn default() -> Self {
        Self { position_m: 12.0e-3 * 25.0 / 15.0, rotation_rad: 7.0 * PI / 180.0 }
    }
}

impl Reach {
    /// Scales the workspace by a factor.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self { position_m: self.position_m * factor, rotation_rad: self.rotation_rad * factor }
    }

    /// Returns the limits of position, m, and rotation, rad.
    pub(super) fn sizes(self) -> [f64; 2] {
        [self.position_m, self.rotation_rad]
    }

    /// Returns true if a pose lies in the workspace.
    pub(super) fn holds(self, pose: Pose) -> bool {
        let rotation_rad = rotation_vector(pose.orientation());
        pose.position().abs().max_element() <= self.position_m
            && rotation_rad.abs().max_element() <= self.rotation_rad
    }

    /// Returns the pose at six coordinates, from 0 to 1 across the workspace.
    pub(super) fn pose(self, unit: [f64; 6]) -> Pose {
        let [x, y, z, rx, ry, rz] = unit.map(|u| 2.0 * u - 1.0);
        at(DVec3::new(x, y, z) * self.position_m, DVec3::new(rx, ry, rz) * self.rotation_rad)
    }
}

/// Sampler of a set: pose and twist by index.
type Sample = fn(Reach, &mut Random, u64) -> (Pose, Twist);

/// Sets of poses that may break a formula but have measure zero in even coverage, with their names in reports.
pub(super) const MANIFOLDS: [(&str, Sample); 9] = [
    ("home", |_, _, index| still(home(index))),
    ("tiny displacements", |_, random, index| still(tiny(random, index))),
    ("shells around home", |_, random, index| still(shell(random, index))),
    ("axes", |reach, random, index| still(axis(reach, random, index))),
    ("coordinate planes", |reach, random, index| still(plane(reach, random, index))),
    ("large rotations", |reach, random, index| still(large_rotation(reach, random, index))),
    ("denormals", |_, random, _| still(denormal(random))),
    ("huge coordinates", |_, random, _| still(huge(random))),
    ("malformed input", malformed),
];

fn still(pose: Pose) -> (Pose, Twist) {
    (pose, Twist::ZERO)
}

/// Period of manifold poses in a mixed sequence.
const MANIFOLD_EVERY: u64 = 8;

/// Returns pose `index` of an even coverage in which every eighth pose is from a manifold, in rotation.
pub(super) fn mixed(reach: Reach, sobol: &Sobol, random: &mut Random, index: u64) -> Pose {
    if !index.is_multiple_of(MANIFOLD_EVERY) {
        return reach.pose(sobol.point(index));
    }
    let number = index / MANIFOLD_EVERY;
    let (_, sample) = MANIFOLDS[usize::try_from(number).unwrap_or(0) % MANIFOLDS.len()];
    sample(reach, random, number).0
}

fn anywhere(reach: Reach, random: &mut Random) -> Pose {
    at(random.vector() * reach.position_m, random.vector() * reach.rotation_rad)
}

/// Draws a number uniform in the exponent.
fn decades(random: &mut Random, from: f64, to: f64) -> f64 {
    math::pow(10.0, from + (to - from) * random.unit())
}

/// Returns home with every sign of zero and both quaternions.
fn home(index: u64) -> Pose {
    let sign = |bit: u32| if index >> bit & 1 == 1 { -1.0 } else { 1.0 };
    Pose {
        position_m: [0.0 * sign(0), 0.0 * sign(1), 0.0 * sign(2)],
        orientation_xyzw: [0.0 * sign(3), 0.0 * sign(4), 0.0 * sign(5), sign(6)],
    }
}

/// Returns poses 1e-15 to 1e-3 m and rad from home, logarithmically uniform.
fn tiny(random: &mut Random, index: u64) -> Pose {
    let position_m = random.direction() * decades(random, -15.0, -3.0);
    let rotation_rad = random.direction() * decades(random, -15.0, -3.0);
    match index % 3 {
        0 => at(position_m, DVec3::ZERO),
        1 => at(DVec3::ZERO, rotation_rad),
        _ => at(position_m, rotation_rad),
    }
}

/// Returns poses on spheres of exactly 10^-k m around home, and a rounding beside them.
fn shell(random: &mut Random, index: u64) -> Pose {
    #[allow(clippy::cast_possible_truncation)] // 1..=15
    let exponent = 1 + (index % 15) as i32;
    let rounding = [0.0, f64::EPSILON, -f64::EPSILON][(index / 15 % 3) as usize];
    let radius_m = math::powi(10.0, -exponent) * (1.0 + rounding);
    let position_m = match index / 45 % 3 {
        0 => random.direction(),
        1 => DVec3::Z,
        _ => DVec3::NEG_Z,
    } * radius_m;
    let rotation_rad = if index.is_multiple_of(2) { DVec3::ZERO } else { random.vector() * radius_m };
    at(position_m, rotation_rad)
}

/// Returns poses with one non-zero coordinate of six.
fn axis(reach: Reach, random: &mut Random, index: u64) -> Pose {
    let only = [DVec3::X, DVec3::Y, DVec3::Z][(index % 3) as usize] * random.symmetric();
    match index / 3 % 2 {
        0 => at(only * reach.position_m, DVec3::ZERO),
        _ => at(DVec3::ZERO, only * reach.rotation_rad),
    }
}

/// Returns poses with one or two coordinates exactly zero.
fn plane(reach: Reach, random: &mut Random, index: u64) -> Pose {
    let (mut position_m, mut rotation_rad) =
        (random.vector() * reach.position_m, random.vector() * reach.rotation_rad);
    for zeroed in [index % 6, index / 6 % 6] {
        match zeroed {
            0 => position_m.x = 0.0,
            1 => position_m.y = 0.0,
            2 => position_m.z = 0.0,
            3 => rotation_rad.x = 0.0,
            4 => rotation_rad.y = 0.0,
            _ => rotation_rad.z = 0.0,
        }
    }
    at(position_m, rotation_rad)
}

/// Returns any rotation up to half a turn, and exactly half a turn.
fn large_rotation(reach: Reach, random: &mut Random, index: u64) -> Pose {
    let axis = match index / 4 % 4 {
        0 => DVec3::X,
        1 => DVec3::Y,
        2 => DVec3::Z,
        _ => random.direction(),
    };
    let angle_rad = match index % 4 {
        0 => PI,
        1 => PI - decades(random, -15.0, -1.0),
        2 => 0.5 * PI + 1.0e-3 * random.symmetric(),
        _ => PI * random.unit(),
    };
    at(random.vector() * reach.position_m, axis * angle_rad)
}

/// Returns poses with coordinates too small for full precision.
fn denormal(random: &mut Random) -> Pose {
    // The smallest normal number is 2.2e-308.
    let mut number =
        || random.symmetric() * f64::MIN_POSITIVE * if random.unit() < 0.5 { 1.0e-12 } else { 1.0 };
    Pose { position_m: [number(), number(), number()], orientation_xyzw: [number(), number(), number(), 1.0] }
}

/// Returns poses with coordinates up to 1e300.
fn huge(random: &mut Random) -> Pose {
    let mut number = || random.symmetric() * decades(random, 0.0, 300.0);
    let position_m = DVec3::new(number(), number(), number());
    at(position_m, random.direction() * PI * random.unit())
}

/// Returns inputs with NaN and infinity in pose or twist, and quaternions not of unit length.
fn malformed(reach: Reach, random: &mut Random, index: u64) -> (Pose, Twist) {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -f64::NAN][(index % 4) as usize];
    let mut pose = anywhere(reach, random);
    let mut twist = Twist::ZERO;
    let kind = index / 4 % 15;
    match kind {
        0..3 => pose.position_m[kind as usize] = bad,
        3..7 => pose.orientation_xyzw[kind as usize - 3] = bad,
        7 => pose.position_m = [bad; 3],
        8 => pose.orientation_xyzw = [bad; 4],
        9 => pose.orientation_xyzw = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0).to_array(),
        10 => pose.orientation_xyzw = pose.orientation_xyzw.map(|number| number * 2.0),
        11 => pose.orientation_xyzw = pose.orientation_xyzw.map(|number| number * 1.0e-200),
        12 => twist.linear_m_per_s = [bad; 3],
        13 => twist.angular_rad_per_s = [bad; 3],
        _ => pose.orientation_xyzw = pose.orientation_xyzw.map(|number| number * 1.0e200),
    }
    (pose, twist)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manifolds_are_where_they_say() {
        let reach = Reach::default();
        let mut random = Random::new(1, 1);
        for index in 0..1000 {
            let mut sample = |name: &str| {
                let named = MANIFOLDS.iter().find(|(other, _)| *other == name);
                named.map(|(_, sample)| sample(reach, &mut random, index)).expect("a manifold")
            };
            let mut pose = |name: &str| sample(name).0;
            assert_eq!(pose("home").position(), DVec3::ZERO);
            assert!(pose("tiny displacements").position().length() <= 1.001e-3);
            let plane = pose("coordinate planes");
            let zeros = plane.position_m.iter().chain(&plane.orientation_xyzw).filter(|n| **n == 0.0);
            assert!(zeros.count() >= 1);
            assert!(pose("denormals").position().length() < 4.0e-308);
            assert!(pose("huge coordinates").is_finite());
            let (pose, twist) = sample("malformed input");
            let unit = (pose.orientation().length() - 1.0).abs() < 1.0e-6;
            assert!(!(pose.is_finite() && twist.is_finite() && unit));
        }
    }
}
