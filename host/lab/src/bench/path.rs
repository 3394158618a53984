//! The motion every case goes along: smooth, in all six coordinates, never at rest for long.

use flotor_hal::{DVec3, Pose};
use flotor_judge::trajectory::{Series, Trajectory};
use std::f64::consts::TAU;

/// Amplitudes and frequencies of a hand that explores an object (the thesis's subjects moved at 1 to 3 Hz, section 4): at
/// most 3.6 mm from the middle, and 3.0° turned. The frequencies have no common period shorter than 100 s, so no two
/// ticks are alike.
const POSITION_M: DVec3 = DVec3::new(1.5e-3, 1.2e-3, 3.0e-3);
const POSITION_HZ: DVec3 = DVec3::new(1.37, 2.11, 1.03);
const ROTATION_RAD: DVec3 = DVec3::new(0.030, 0.025, 0.035);
const ROTATION_HZ: DVec3 = DVec3::new(1.71, 2.53, 2.97);

/// The motion about a point below home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// How far below home the middle of the motion lies, m.
    pub depth_m: f64,
}

impl Default for Hand {
    /// About 4 mm below home: a spring of the thesis between free and a third of its length.
    fn default() -> Self {
        Self { depth_m: 4.0e-3 }
    }
}

impl Hand {
    /// Its poses, by time in s.
    pub(super) fn trajectory(self) -> Trajectory {
        let mut position = Series::sines(POSITION_M, POSITION_HZ * TAU);
        position.mean = DVec3::Z * -self.depth_m;
        Trajectory { position, rotation: Series::sines(ROTATION_RAD, ROTATION_HZ * TAU) }
    }

    /// The poses of the first ticks, at 1 kHz.
    pub(super) fn poses(self, ticks: usize) -> Vec<Pose> {
        let trajectory = self.trajectory();
        (0..ticks).map(|tick| trajectory.pose(tick as f64 * 1.0e-3)).collect()
    }
}
