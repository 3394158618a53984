//! Motions of the cases in all six coordinates: of a hand about a point, and through the workspace.

use flotor_hal::{DVec3, Pose, math, orientation_from_rotation_vector};
use flotor_judge::trajectory::{Series, Trajectory};
use std::f64::consts::TAU;

/// Amplitudes and frequencies of a hand that explores an object (the thesis's subjects moved at 1 to 3 Hz, section 4):
/// at most 3.6 mm from the middle, and 3.0° of rotation. The frequencies have no common period below 100 s, so no two
/// ticks are alike.
const POSITION_M: DVec3 = DVec3::new(1.5e-3, 1.2e-3, 3.0e-3);
const POSITION_HZ: DVec3 = DVec3::new(1.37, 2.11, 1.03);
const ROTATION_RAD: DVec3 = DVec3::new(0.030, 0.025, 0.035);
const ROTATION_HZ: DVec3 = DVec3::new(1.71, 2.53, 2.97);

/// Motion of a hand about a point below home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Depth of the middle of the motion below home, m.
    pub depth_m: f64,
}

impl Default for Hand {
    /// Returns a depth of 4 mm below home: with the amplitude of the motion, the thesis's first spring (25 mm) is compressed by
    /// up to about a third of its length.
    fn default() -> Self {
        Self { depth_m: 4.0e-3 }
    }
}

impl Hand {
    /// Returns the trajectory by time in s.
    pub(super) fn trajectory(self) -> Trajectory {
        let mut position = Series::sines(POSITION_M, POSITION_HZ * TAU);
        position.mean = DVec3::Z * -self.depth_m;
        Trajectory { position, rotation: Series::sines(ROTATION_RAD, ROTATION_HZ * TAU) }
    }

    /// Returns the poses of the first `ticks` ticks, at 1 kHz.
    #[must_use]
    pub fn poses(self, ticks: usize) -> Vec<Pose> {
        let trajectory = self.trajectory();
        (0..ticks).map(|tick| trajectory.pose(tick as f64 * 1.0e-3)).collect()
    }
}

/// Motion through a whole workspace, a ball of positions and a ball of rotations about home. The time in each part is proportional
/// to its volume, so a mean over many sweeps is a mean over uniformly distributed poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Radius of the ball of positions, m.
    pub radius_m: f64,
    /// Largest angle of a rotation, rad.
    pub rotation_rad: f64,
}

/// Frequencies of the six coordinates, Hz: those of a hand, without a common period.
const SWEEPS_HZ: [[f64; 3]; 2] = [[0.618, 1.303, 1.732], [0.541, 1.618, 2.236]];

impl Workspace {
    /// Returns the workspace with radius and rotation multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { radius_m: self.radius_m * factor, rotation_rad: self.rotation_rad * factor }
    }

    /// Returns the poses of the first `ticks` ticks, at 1 kHz.
    #[must_use]
    pub fn poses(self, ticks: usize) -> Vec<Pose> {
        let pose = |tick: usize| {
            let [position, rotation] = SWEEPS_HZ.map(|rates_hz| in_unit_ball(tick as f64 * 1.0e-3, rates_hz));
            Pose::new(
                position * self.radius_m,
                orientation_from_rotation_vector(rotation * self.rotation_rad),
            )
        };
        (0..ticks).map(pose).collect()
    }
}

/// Returns the position of a point that spends equal times in equal volumes of the unit ball: the cube of its radius
/// and the cosine of its polar angle rise and fall linearly, and its azimuth turns at constant speed.
fn in_unit_ball(time_s: f64, [radius_hz, polar_hz, azimuth_hz]: [f64; 3]) -> DVec3 {
    let rise_and_fall = |rate_hz: f64| {
        let phase = rate_hz * time_s % 1.0;
        1.0 - (2.0 * phase - 1.0).abs()
    };
    let radius = math::cbrt(rise_and_fall(radius_hz));
    let cosine = 2.0 * rise_and_fall(polar_hz) - 1.0;
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let azimuth = TAU * azimuth_hz * time_s;
    DVec3::new(sine * math::cos(azimuth), sine * math::sin(azimuth), cosine) * radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::rotation_vector;

    /// Means over a ball of radius 1: of the radius 3/4, of each coordinate 0, of its square 1/5. The motion is a line on a torus, so its
    /// means approach these as one over the number of sweeps, 11 to 45 in 20 s: within 2 %.
    #[test]
    fn equal_volumes_take_equal_times() {
        let poses = Workspace { radius_m: 2.0, rotation_rad: 0.5 }.poses(20_000);
        let balls: [fn(&Pose) -> DVec3; 2] =
            [|pose| pose.position() / 2.0, |pose| rotation_vector(pose.orientation()) / 0.5];
        for ball in balls {
            let count = poses.len() as f64;
            let radius = poses.iter().map(|pose| ball(pose).length()).sum::<f64>() / count;
            let mean = poses.iter().map(ball).sum::<DVec3>() / count;
            let squares = poses.iter().map(|pose| ball(pose) * ball(pose)).sum::<DVec3>() / count;
            assert!((radius - 0.75).abs() < 0.02, "{radius}");
            assert!(mean.abs().max_element() < 0.02, "{mean}");
            assert!((squares - DVec3::splat(0.2)).abs().max_element() < 0.02, "{squares}");
            assert!(poses.iter().all(|pose| ball(pose).length() < 1.0 + 1.0e-12));
        }
    }
}
