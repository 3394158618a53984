//! Simulated sampling at a fixed rate of the system clock, for a loop paced by the simulated device.

use flotor_hal::SampleWait;
use std::time::{Duration, Instant};

/// Clock with one sample per period, from the first wait on.
pub(crate) struct SampleClock {
    period: Duration,
    started: Option<Instant>,
    /// Samples reported by earlier waits.
    reported: u64,
}

impl SampleClock {
    pub(crate) fn new(period_ns: u64) -> Self {
        Self { period: Duration::from_nanos(period_ns.max(1)), started: None, reported: 0 }
    }

    /// Sleeps until a sample is available that no earlier call has counted, or until `timeout`; returns the number of
    /// such samples.
    pub(crate) fn wait(&mut self, timeout: Duration) -> SampleWait {
        let since = self.started.get_or_insert_with(Instant::now).elapsed();
        let next = Duration::from_nanos(self.nanoseconds(self.reported + 1));
        let until_next = next.saturating_sub(since);
        std::thread::sleep(until_next.min(timeout));
        let taken = self.taken();
        let samples = taken - self.reported.min(taken);
        self.reported = taken.max(self.reported);
        if samples == 0 { SampleWait::TimedOut } else { SampleWait::Arrived { samples } }
    }

    #[allow(clippy::cast_possible_truncation)] // 2^64 ns are centuries
    fn taken(&self) -> u64 {
        let since = self.started.map_or(Duration::ZERO, |started| started.elapsed());
        (since.as_nanos() / self.period.as_nanos()) as u64
    }

    #[allow(clippy::cast_possible_truncation)] // 2^64 ns are centuries
    fn nanoseconds(&self, samples: u64) -> u64 {
        samples.saturating_mul(self.period.as_nanos() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_nobody_waited_for_are_counted_and_none_twice() {
        let started = Instant::now();
        let mut clock = SampleClock::new(1_000_000);
        let mut next = || match clock.wait(Duration::from_secs(1)) {
            SampleWait::Arrived { samples } => samples,
            other => panic!("{other:?}"),
        };
        let first = next();
        std::thread::sleep(Duration::from_millis(20));
        let reported = first + next();
        // A busy machine makes all of it longer.
        let taken = started.elapsed().as_millis();
        assert!(first >= 1 && reported >= 21 && u128::from(reported) <= taken, "{reported} of {taken}");
    }

    #[test]
    fn a_wait_that_is_shorter_than_the_period_ends_without_a_sample() {
        let mut clock = SampleClock::new(3_600_000_000_000);
        assert_eq!(clock.wait(Duration::from_millis(1)), SampleWait::TimedOut);
    }
}
