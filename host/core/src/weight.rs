//! Weight that moves to its target at a constant rate.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

/// Weight from 0 to 1, a function of time alone: the weight needs no updates, and does not depend on the number of queries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade {
    from: f64,
    target: f64,
    /// Start of the movement, ns.
    since_ns: u64,
    /// Change per nanosecond; infinite for a step.
    rate_per_ns: f64,
}

impl Fade {
    /// Creates a constant weight `at`, which takes `fade_s` seconds for a change from 0 to 1.
    #[must_use]
    pub fn new(at: f64, fade_s: f64) -> Self {
        let at = at.clamp(0.0, 1.0);
        Self { from: at, target: at, since_ns: 0, rate_per_ns: 1.0e-9 / fade_s }
    }

    /// Sets the target, 0 to 1 (clamped), to which the weight moves from its present value. Real-time: bounded, no allocation.
    #[inline]
    pub fn set_target(&mut self, target: f64, now_ns: u64) {
        let target = target.clamp(0.0, 1.0);
        if target != self.target {
            *self = Self { from: self.at(now_ns), target, since_ns: now_ns, ..*self };
        }
    }

    /// Returns the weight at the run time `now_ns`. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn at(&self, now_ns: u64) -> f64 {
        if self.from == self.target {
            return self.target; // it never moved
        }
        let way = self.target - self.from;
        let moved = self.rate_per_ns * now_ns.saturating_sub(self.since_ns) as f64;
        // An infinite rate times zero time is NaN, which is not below the distance: a step takes effect at once.
        if moved < way.abs() { self.from + moved.copysign(way) } else { self.target }
    }

    /// Returns true if the weight is 0 and has no other target. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_silent(&self, now_ns: u64) -> bool {
        self.target == 0.0 && self.at(now_ns) == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn it_goes_to_its_target_at_its_rate_and_not_beyond() {
        let mut fade = Fade::new(0.0, 0.004);
        assert!(fade.is_silent(7));
        fade.set_target(1.0, 10 * MS);
        assert!(!fade.is_silent(10 * MS));
        for (ms, expected) in [(10, 0.0), (11, 0.25), (12, 0.5), (14, 1.0), (1000, 1.0)] {
            assert!((fade.at(ms * MS) - expected).abs() < 1.0e-12, "{ms} ms");
        }
        fade.set_target(-3.0, 12 * MS); // half-way up
        assert!((fade.at(13 * MS) - 0.25).abs() < 1.0e-12);
        assert!(!fade.is_silent(13 * MS) && fade.is_silent(14 * MS));
    }

    #[test]
    fn to_be_told_the_same_again_changes_nothing() {
        let mut told_once = Fade::new(0.0, 0.004);
        told_once.set_target(1.0, 0);
        let mut told_often = told_once;
        (0..9).for_each(|ms| told_often.set_target(1.0, ms * MS));
        assert_eq!(told_once, told_often);
    }

    #[test]
    fn no_time_to_fade_in_is_a_step() {
        let mut fade = Fade::new(0.0, 0.0);
        fade.set_target(1.0, 5);
        assert_eq!(fade.at(5), 1.0);
    }
}
