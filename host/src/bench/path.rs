//! The motion every case goes along: smooth, in all six coordinates, never at rest for long.

use flotor_hal::{DVec3, Pose, math, orientation_from_rotation_vector};
use std::f64::consts::TAU;

/// Amplitude and frequency of a coordinate, m or rad and Hz. Within ±4 mm and ±2°, at 1 to 3 Hz: what a hand
/// does that explores an object (the thesis's subjects moved at 1 to 3 Hz, section 4). The frequencies have no common
/// period shorter than 100 s, so no two ticks are alike.
const COORDINATES: [(f64, f64); 6] =
    [(1.5e-3, 1.37), (1.2e-3, 2.11), (3.0e-3, 1.03), (0.030, 1.71), (0.025, 2.53), (0.035, 2.97)];

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
    /// Pose at a time, s.
    pub(super) fn at(self, time_s: f64) -> Pose {
        let [x, y, z, rx, ry, rz] =
            COORDINATES.map(|(amplitude, frequency_hz)| amplitude * math::sin(TAU * frequency_hz * time_s));
        let position_m = DVec3::new(x, y, z - self.depth_m);
        Pose::new(position_m, orientation_from_rotation_vector(DVec3::new(rx, ry, rz)))
    }

    /// The poses of the first ticks, at 1 kHz.
    pub(super) fn poses(self, ticks: usize) -> Vec<Pose> {
        #[allow(clippy::cast_precision_loss)] // far fewer than 2^53 ticks
        (0..ticks).map(|tick| self.at(tick as f64 * 1.0e-3)).collect()
    }
}
