//! How long things take within a tick, from the processor's own counter of time.
//!
//! The system's clock is read by an instruction that waits until all before it is done, and lets nothing after it begin:
//! it costs a tick twice what the reading itself takes. The counter is read on the way. How fast it counts is measured once,
//! against the system's clock; where a processor has none that is steady, the system's clock it is.
//!
//! Deadlines and lateness are the system's clock's alone (`clock.rs`).

use quanta::Clock;

/// A place on the counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moment(u64);

/// Reads the counter.
pub(super) struct Stopwatch(Clock);

impl Stopwatch {
    /// Not real-time: the first one of a process measures how fast the counter is, for some 10 ms.
    pub(super) fn new() -> Self {
        Self(Clock::new())
    }

    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn now(&self) -> Moment {
        Moment(self.0.raw())
    }

    /// Time from one moment to another, ns; 0 if the other was before it. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn between_ns(&self, from: Moment, to: Moment) -> u64 {
        self.0.delta_as_nanos(from.0, to.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo::clock::monotonic_ns;

    /// Between two looks at the system's clock there is no more time than these say.
    #[test]
    fn the_counter_and_the_clock_agree() {
        let stopwatch = Stopwatch::new();
        let least_error = (0..100).map(|_| {
            let (outer, from) = (monotonic_ns(), stopwatch.now());
            let inner = monotonic_ns();
            while monotonic_ns() < inner + 1_000_000 {
                std::hint::spin_loop();
            }
            let inner_ns = monotonic_ns() - inner;
            let (to, outer_ns) = (stopwatch.now(), monotonic_ns() - outer);
            let took_ns = stopwatch.between_ns(from, to);
            took_ns.saturating_sub(outer_ns).max(inner_ns.saturating_sub(took_ns))
        });
        // A hundredth of a percent of a millisecond, in the best of a hundred tries on a busy machine.
        assert!(least_error.min() <= Some(100));
    }

    #[test]
    fn a_moment_before_is_no_time_ago() {
        let stopwatch = Stopwatch::new();
        let (before, after) = (stopwatch.now(), stopwatch.now());
        assert_eq!(stopwatch.between_ns(after, Moment(before.0 - 1)), 0);
    }
}
