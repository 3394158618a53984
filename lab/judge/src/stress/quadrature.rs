//! Work of a lap by Romberg's rule, on intervals that are split adaptively.
//!
//! A sum of evenly spaced samples converges faster than any power of their distance where the power is smooth, but only
//! quadratically where it has a kink, as on the surface of a wall. Here the splitting confines a kink to an interval of a millionth
//! of the lap, so that 1e-9 of the work can be distinguished from zero. Every lap takes all samples in their order, because a model
//! may have memory.

/// Number of intervals of the first lap.
const INTERVALS: usize = 256;
/// Number of samples of an interval.
const SAMPLES: usize = 8;
/// Number of parts of a split interval.
const PARTS: usize = 8;
/// Maximum number of laps, each with more intervals split.
const MOST_LAPS: usize = 5;
/// Fraction of the bound that the total uncertainty may reach.
const ALLOWED: f64 = 0.1;
/// Safety factor on the difference of two orders of the rule: at a kink both may have the same error.
const CAUTION: f64 = 2.0;

/// Work of a lap, or of an interval of a lap.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Work {
    /// Work on the hand, J.
    pub(super) net_j: f64,
    /// Absolute work exchanged with the hand (integral of the magnitude of the power), J.
    pub(super) gross_j: f64,
    /// Uncertainty of the work on the hand, J.
    pub(super) uncertain_j: f64,
}

impl Work {
    fn and(self, other: &Self) -> Self {
        Self {
            net_j: self.net_j + other.net_j,
            gross_j: self.gross_j + other.gross_j,
            uncertain_j: self.uncertain_j + other.uncertain_j,
        }
    }

    /// Integrates an interval from its length and the powers from end to end.
    fn of_interval(length: f64, powers: &[f64]) -> Self {
        let &[p0, p1, p2, p3, p4, p5, p6, p7, p8] = powers else { return Self::default() };
        // Trapezoids of 1, 2, 4 and 8 steps, extrapolated to orders 4, 6 and 8.
        let t0 = 0.5 * (p0 + p8);
        let t1 = 0.5 * (t0 + p4);
        let t2 = 0.5 * (t1 + 0.5 * (p2 + p6));
        let t3 = 0.5 * (t2 + 0.25 * (p1 + p3 + p5 + p7));
        let [s1, s2, s3] = [(t0, t1), (t1, t2), (t2, t3)].map(|(coarse, fine)| fine + (fine - coarse) / 3.0);
        let [b2, b3] = [(s1, s2), (s2, s3)].map(|(coarse, fine)| fine + (fine - coarse) / 15.0);
        let magnitude = powers.iter().map(|power| power.abs()).sum::<f64>() / powers.len() as f64;
        Self {
            net_j: length * (b3 + (b3 - b2) / 63.0),
            gross_j: length * magnitude,
            uncertain_j: length * CAUTION * (b3 - b2).abs(),
        }
    }
}

/// Returns the work of a lap. Splits intervals until the uncertainty is at most [`ALLOWED`] times `bound` of the gross
/// work, or for [`MOST_LAPS`] laps. `powers` runs a lap and returns the powers (J per lap) at increasing fractions of
/// it, from 0 on and below 1; `None` without an answer. Not real-time.
pub(super) fn work(bound: f64, mut powers: impl FnMut(&[f64]) -> Option<Vec<f64>>) -> Option<Work> {
    let mut ends: Vec<f64> = (0..=INTERVALS).map(|index| index as f64 / INTERVALS as f64).collect();
    for lap in 1.. {
        let parts: Vec<f64> = ends.windows(2).flat_map(|pair| between(pair, SAMPLES)).collect();
        let mut powers = powers(&parts)?;
        // A lap is closed: append its first power.
        powers.extend(powers.first().copied());
        let intervals = ends.windows(2).zip(powers.windows(SAMPLES + 1).step_by(SAMPLES));
        let works: Vec<Work> =
            intervals.map(|(pair, powers)| Work::of_interval(pair[1] - pair[0], powers)).collect();
        let whole = works.iter().fold(Work::default(), |whole, work| whole.and(work));
        if lap == MOST_LAPS || whole.uncertain_j <= ALLOWED * bound * whole.gross_j {
            return Some(whole);
        }
        let allowed_j = ALLOWED * bound * whole.gross_j / works.len() as f64;
        let parts = |work: &Work| if work.uncertain_j > allowed_j { PARTS } else { 1 };
        let split = ends.windows(2).zip(&works).flat_map(|(pair, work)| between(pair, parts(work)));
        ends = split.chain([1.0]).collect();
    }
    None
}

/// Returns evenly spaced points of an interval, including its start, excluding its end.
fn between(pair: &[f64], count: usize) -> impl Iterator<Item = f64> + use<> {
    let (from, to) = (pair[0], pair[1]);
    (0..count).map(move |index| from + (to - from) * index as f64 / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const BOUND: f64 = 1.0e-9;

    fn of(power: impl Fn(f64) -> f64) -> Work {
        let all = |parts: &[f64]| {
            assert!(parts.is_sorted() && parts.iter().all(|part| (0.0..1.0).contains(part)));
            Some(parts.iter().map(|part| power(*part)).collect())
        };
        work(BOUND, all).expect("it has an answer")
    }

    #[test]
    fn smooth_powers_and_kinks_are_known_to_the_bound() {
        let smooth = of(|part| (3.0 * TAU * part).sin() + 0.25);
        let kinked = of(|part| (TAU * part + 0.4).sin().abs());
        for (work, exact) in [(smooth, 0.25), (kinked, 4.0 / TAU)] {
            assert!(work.uncertain_j <= BOUND * work.gross_j, "{work:?}");
            assert!((work.net_j - exact).abs() <= work.uncertain_j + 1.0e-15, "{work:?} {exact}");
        }
    }

    #[test]
    fn a_small_pump_is_distinguished_from_the_kinks_it_hides_in() {
        let pump = |made: f64| {
            of(move |part| (TAU * part + 0.1).sin().max(0.0) * (1.0 + made) - (TAU * part).sin().max(0.0))
        };
        let [none, some] = [0.0, 1.0e-7].map(pump);
        assert!(none.net_j.abs() <= none.uncertain_j, "{none:?}");
        // The integral of half a sine is 1/pi.
        assert!(
            (some.net_j - 1.0e-7 * 2.0 / TAU).abs() <= some.uncertain_j
                && some.net_j > 10.0 * some.uncertain_j,
            "{some:?}"
        );
    }

    #[test]
    fn a_jump_stays_uncertain() {
        let jump = of(|part| if (0.2..0.654_321).contains(&part) { 1.0 } else { -1.0 });
        assert!((jump.net_j - (2.0 * 0.454_321 - 1.0)).abs() <= jump.uncertain_j, "{jump:?}");
        assert!(jump.uncertain_j > BOUND, "{jump:?}");
    }
}
