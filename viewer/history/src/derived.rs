//! Quantities derived from several samples: stiffness felt along the motion, and force over position with its hysteresis.

use crate::Sample;
use flotor_hal::DVec3;

/// Smallest displacement of the handle for a stiffness, m: ten steps of a common position sensor.
const LEAST_WAY_M: f64 = 50.0e-6;

/// Threshold of a point with force, as a fraction of the largest force: above the rounding of a recording.
const LEAST_FORCE: f64 = 0.01;

/// Returns the stiffness felt along the motion, N/m: the secant `-dF/dx` from the newest earlier sample at a distance of at least
/// 50 µm (`earlier` has the newest first). Positive where the force grows against the motion; NaN without such a sample, as while
/// the handle rests.
#[must_use]
pub fn felt_stiffness_n_per_m<'a>(earlier: impl Iterator<Item = &'a Sample>, now: &Sample) -> f64 {
    for before in earlier {
        let way_m: DVec3 = now.pose.position() - before.pose.position();
        let square = way_m.length_squared();
        if square >= LEAST_WAY_M * LEAST_WAY_M {
            return -(now.force_n() - before.force_n()).dot(way_m) / square;
        }
    }
    f64::NAN
}

/// Force over position along an axis of the device frame, during a time span.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForcePosition {
    /// Position, m, and force on the hand, N, in order of time.
    pub points: Vec<[f64; 2]>,
    /// Stiffness fitted to the points with more than 1 % of the largest force (contact without free motion), N/m; `None` if the
    /// standard deviation of their positions is at most 50 µm.
    pub stiffness_n_per_m: Option<f64>,
    /// Stiffness fitted to all points, N/m; `None` if the standard deviation of the positions is at most 50 µm.
    pub stiffness_of_all_n_per_m: Option<f64>,
    /// Number of whole cycles, and mean energy that a cycle takes from the hand, J: the area of the loop. `None` without a whole
    /// cycle.
    pub cycles: Option<(u32, f64)>,
}

impl ForcePosition {
    /// Evaluates samples in order of time, for the axis 0, 1 or 2 (x, y, z).
    #[must_use]
    pub fn of<'a>(samples: impl Iterator<Item = &'a Sample>, axis: usize) -> Self {
        let axis = axis.min(2);
        let points: Vec<[f64; 2]> = samples
            .map(|sample| [sample.pose.position().to_array()[axis], sample.force_n().to_array()[axis]])
            .filter(|point| point.iter().all(|part| part.is_finite()))
            .collect();
        let largest_n = points.iter().map(|[_, force]| force.abs()).fold(0.0, f64::max);
        let has_force = |point: &&[f64; 2]| point[1].abs() > LEAST_FORCE * largest_n;
        let with_force: Vec<[f64; 2]> = points.iter().filter(has_force).copied().collect();
        Self {
            stiffness_n_per_m: stiffness(&with_force),
            stiffness_of_all_n_per_m: stiffness(&points),
            cycles: cycles(&points),
            points,
        }
    }

    /// Returns at most `most` of the points, evenly spaced by index.
    pub fn thinned(&self, most: usize) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().copied().step_by(self.points.len().div_ceil(most.max(1)).max(1))
    }
}

fn stiffness(points: &[[f64; 2]]) -> Option<f64> {
    let count = points.len() as f64;
    let mean = |k: usize| points.iter().map(|point| point[k]).sum::<f64>() / count;
    let (x, force) = (mean(0), mean(1));
    let square: f64 = points.iter().map(|point| (point[0] - x).powi(2)).sum();
    let product: f64 = points.iter().map(|point| (point[0] - x) * (point[1] - force)).sum();
    (square > count * LEAST_WAY_M * LEAST_WAY_M).then(|| -product / square)
}

/// Counts the cycles between upward crossings of the middle of the range, and returns the mean work of the hand per cycle, J.
fn cycles(points: &[[f64; 2]]) -> Option<(u32, f64)> {
    /// Hysteresis of a crossing, as a fraction of the range.
    const AWAY: f64 = 0.1;
    let (low, high) =
        points.iter().fold((f64::MAX, f64::MIN), |(low, high), [x, _]| (low.min(*x), high.max(*x)));
    let (middle, away) = (0.5 * (low + high), AWAY * (high - low));
    if points.is_empty() || high - low < LEAST_WAY_M {
        return None;
    }
    let (mut was_below, mut crossings, mut work_j, mut whole_j) = (false, 0_u32, 0.0, 0.0);
    for (from, to) in points.iter().zip(points.iter().skip(1)) {
        if crossings > 0 {
            work_j -= 0.5 * (from[1] + to[1]) * (to[0] - from[0]);
        }
        was_below |= to[0] < middle - away;
        if was_below && to[0] >= middle {
            (was_below, whole_j) = (false, work_j);
            crossings += 1;
            if crossings == 1 {
                (work_j, whole_j) = (0.0, 0.0);
            }
        }
    }
    (crossings > 1).then(|| (crossings - 1, whole_j / f64::from(crossings - 1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::{RECORD_WORDS, TickRecord};
    use flotor_sync::Words;
    use std::f64::consts::{PI, TAU};

    const STIFFNESS: f64 = 700.0;
    const DAMPING: f64 = 2.0;
    const AMPLITUDE_M: f64 = 0.003;

    /// Two and a half seconds of a spring with a damper, moved up and down once a second.
    fn spring_and_damper(damping: f64) -> Vec<Sample> {
        let sample = |tick: i32| {
            let phase = TAU * f64::from(tick) * 1.0e-3;
            let (z, v) = (AMPLITUDE_M * phase.sin(), AMPLITUDE_M * TAU * phase.cos());
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            record.pose.position_m = [0.0, 0.0, z];
            record.commanded.force_n = [0.0, 0.0, -STIFFNESS * z - damping * v];
            Sample::from(&record)
        };
        (0..2500).map(sample).collect()
    }

    /// A damper takes pi c w A^2 a cycle.
    #[test]
    fn the_loop_of_a_damped_spring_has_the_area_of_its_ellipse() {
        let found = ForcePosition::of(spring_and_damper(DAMPING).iter(), 2);
        let (cycles, loss_j) = found.cycles.expect("two whole cycles at least");
        let expected_j = PI * DAMPING * TAU * AMPLITUDE_M * AMPLITUDE_M;
        assert!(cycles >= 1 && (loss_j / expected_j - 1.0).abs() < 0.01, "{loss_j} of {expected_j}");
        let spring = ForcePosition::of(spring_and_damper(0.0).iter(), 2);
        let stiffness = spring.stiffness_n_per_m.expect("it moved");
        assert!((stiffness / STIFFNESS - 1.0).abs() < 1.0e-5, "{stiffness}");
        assert!(spring.cycles.expect("cycles").1.abs() < 0.01 * expected_j, "a spring takes nothing");
        assert!(spring.thinned(100).count() <= 100);
        let at_rest = ForcePosition::of(spring_and_damper(0.0)[..2].iter(), 0);
        let fits = (at_rest.stiffness_n_per_m, at_rest.stiffness_of_all_n_per_m);
        assert_eq!((fits, at_rest.cycles), ((None, None), None));
    }

    /// A wall has its stiffness, whatever time the handle spends in the air before it.
    #[test]
    fn the_stiffness_of_a_wall_is_that_of_the_contact() {
        const WALL_N_PER_M: f64 = 2000.0;
        let sample = |tick: i32| {
            let z = 0.001 + 0.004 * (TAU * f64::from(tick) * 1.0e-3).sin();
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            record.pose.position_m = [0.0, 0.0, z];
            record.commanded.force_n = [0.0, 0.0, (-WALL_N_PER_M * z).max(0.0)];
            Sample::from(&record)
        };
        let samples: Vec<Sample> = (0..2500).map(sample).collect();
        let found = ForcePosition::of(samples.iter(), 2);
        let [contact, all] =
            [found.stiffness_n_per_m, found.stiffness_of_all_n_per_m].map(|fit| fit.expect("it moved"));
        // A sample holds its force in single precision.
        assert!((contact / WALL_N_PER_M - 1.0).abs() < 1.0e-5, "{contact}");
        assert!(all < 0.8 * WALL_N_PER_M, "the line through the air, too, is flatter: {all}");
    }

    #[test]
    fn the_stiffness_along_the_motion_is_that_of_the_spring() {
        let samples = spring_and_damper(0.0);
        let felt = felt_stiffness_n_per_m(samples[..100].iter().rev(), &samples[100]);
        assert!((felt / STIFFNESS - 1.0).abs() < 1.0e-3, "{felt}");
        assert!(felt_stiffness_n_per_m(samples[..1].iter(), &samples[1]).is_nan(), "it has hardly moved");
    }
}
