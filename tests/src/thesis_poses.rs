//! Poses that fill the workspace of the thesis.

use flotor_hal::DVec3;

/// Returns position, m, and rotation vector, rad, of pose number `index`: up to a quarter of the free length along x and y,
/// between 40 % compression and 20 % extension, and up to 7 degrees about each axis.
///
/// The poses are a low-discrepancy sequence: the additive recurrence of the generalised golden ratio in six dimensions.
#[must_use]
pub fn thesis_pose(index: usize, free_length_m: f64) -> (DVec3, DVec3) {
    const STEPS: [f64; 6] = [
        0.891_487_826_846_4,
        0.794_750_545_400_7,
        0.708_508_436_203_4,
        0.631_624_657_243_1,
        0.563_083_683_016_8,
        0.501_980_271_028_8,
    ];
    let [x, y, z, rx, ry, rz] = STEPS.map(|step| 2.0 * (step * index as f64).fract() - 1.0);
    (DVec3::new(0.25 * x, 0.25 * y, 0.3 * z - 0.1) * free_length_m, DVec3::new(rx, ry, rz) * 0.122)
}
