//! The motion every case goes along: smooth, in all six coordinates, never at rest for long.

use flotor_hal::{DVec3, Pose, orientation_from_rotation_vector};
use std::f64::consts::TAU;

/// Amplitude, mean and frequency of a coordinate, m or rad and Hz. Within ±4 mm and ±2°, at 1 to 3 Hz: what a hand
/// does that explores an object (the thesis's subjects moved at 1 to 3 Hz, section 4). The frequencies have no common
/// period shorter than 100 s, so no two ticks are alike.
const COORDINATES: [(f64, f64, f64); 6] = [
    (1.5e-3, 0.0, 1.37),
    (1.2e-3, 0.0, 2.11),
    (3.0e-3, -4.0e-3, 1.03),
    (0.030, 0.0, 1.71),
    (0.025, 0.0, 2.53),
    (0.035, 0.0, 2.97),
];

/// Pose at a time, s.
pub(super) fn at(time_s: f64) -> Pose {
    let [x, y, z, rx, ry, rz] =
        COORDINATES.map(|(amplitude, mean, hz)| mean + amplitude * (TAU * hz * time_s).sin());
    Pose::new(DVec3::new(x, y, z), orientation_from_rotation_vector(DVec3::new(rx, ry, rz)))
}

/// The path at 1 kHz.
pub(super) fn smooth(ticks: usize) -> Vec<Pose> {
    #[allow(clippy::cast_precision_loss)] // far fewer than 2^53 ticks
    (0..ticks).map(|tick| at(tick as f64 * 1.0e-3)).collect()
}
