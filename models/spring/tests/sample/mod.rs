//! Reproducible poses and loops for tests of invariance and energy.

use flotor_hal::glam::DVec3;
use flotor_spring::pose::Pose;

/// Each day a part of the work, `full` all of it, with the same seeds and bounds.
///
/// The variable is that of `flotor_tests::TestSize`; plugins depend on nothing else of the workspace, so it is read here.
pub(crate) fn of(all: u32, day: u32) -> u32 {
    match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => all,
        Ok("quick" | "daily") | Err(_) => day,
        Ok(other) => panic!("FLOTOR_TEST_SIZE is `quick`, `daily` or `full`, not `{other}`"),
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014): small, seedable, the same everywhere.
pub(crate) struct Sampler(u64);

impl Sampler {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in -1..1.
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        // The upper 32 bits are plenty for test data, and exact in f64.
        f64::from((bits >> 32) as u32) / f64::from(1u32 << 31) - 1.0
    }

    /// Vector in a cube of the given half edges.
    pub(crate) fn vector(&mut self, half_edges: [f64; 3]) -> DVec3 {
        DVec3::from_array(half_edges.map(|half| half * self.signed()))
    }
}

/// Limits of sampled poses: shear and height change in free lengths, rotation vector in radians.
#[derive(Clone, Copy)]
pub(crate) struct Workspace {
    pub(crate) shear: f64,
    pub(crate) height: f64,
    pub(crate) tilt_rad: f64,
    pub(crate) yaw_rad: f64,
}

impl Workspace {
    pub(crate) fn pose(self, sampler: &mut Sampler, free_length_m: f64) -> Pose {
        let position_m = sampler.vector([self.shear, self.shear, self.height]) * free_length_m;
        Pose::from_rotation_vector(position_m, sampler.vector([self.tilt_rad, self.tilt_rad, self.yaw_rad]))
    }
}

/// A smooth closed path of poses: two harmonics in position and rotation vector.
pub(crate) struct Loop {
    position_m: [DVec3; 5],
    rotation_rad: [DVec3; 5],
}

impl Loop {
    pub(crate) fn new(sampler: &mut Sampler, workspace: Workspace, free_length_m: f64) -> Self {
        // A constant and four harmonics share the workspace.
        let Workspace { shear, height, tilt_rad, yaw_rad } = workspace;
        Self {
            position_m: [(); 5].map(|()| sampler.vector([shear, shear, height]) * (0.2 * free_length_m)),
            rotation_rad: [(); 5].map(|()| sampler.vector([tilt_rad, tilt_rad, yaw_rad]) * 0.2),
        }
    }

    /// Pose, linear and angular velocity per radian of the phase.
    pub(crate) fn at(&self, phase: f64) -> (Pose, DVec3, DVec3) {
        let (s1, c1) = phase.sin_cos();
        let (s2, c2) = (2.0 * phase).sin_cos();
        let combine = |parts: &[DVec3; 5], weights: [f64; 5]| {
            parts.iter().zip(weights).map(|(part, weight)| *part * weight).sum::<DVec3>()
        };
        let value = [1.0, c1, s1, c2, s2];
        let rate = [0.0, -s1, c1, -2.0 * s2, 2.0 * c2];
        let rotation = combine(&self.rotation_rad, value);
        let pose = Pose::from_rotation_vector(combine(&self.position_m, value), rotation);
        let angular = angular_velocity(rotation, combine(&self.rotation_rad, rate));
        (pose, combine(&self.position_m, rate), angular)
    }
}

/// Angular velocity of a changing rotation vector: the left Jacobian of SO(3).
fn angular_velocity(rotation: DVec3, rate: DVec3) -> DVec3 {
    let angle2 = rotation.length_squared();
    let (first, second) = if angle2 > 1e-8 {
        let angle = angle2.sqrt();
        ((1.0 - angle.cos()) / angle2, (angle - angle.sin()) / (angle2 * angle))
    } else {
        (0.5, 1.0 / 6.0)
    };
    let turned = rotation.cross(rate);
    rate + turned * first + rotation.cross(turned) * second
}
