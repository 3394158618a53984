//! How the loop keeps time: histograms of lateness and compute time, in fixed memory, always on.

use hdrhistogram::Histogram;
use serde::Serialize;

/// Longest time a histogram tells apart, ns; longer ones count as this.
const LONGEST_NS: u64 = 100_000_000_000;

/// Two significant digits: a bin is at most 1 % wide, and the whole histogram is some 16 kB.
const DIGITS: u8 = 2;

/// Percentiles of one histogram, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Percentiles {
    /// Half of the ticks are below this.
    pub p50: u64,
    /// 99 %.
    pub p99: u64,
    /// 99.9 %.
    pub p999: u64,
    /// The worst.
    pub max: u64,
}

/// A histogram of durations. Its bins are those of an [`hdrhistogram::Histogram`] of two decimal digits, into which they are
/// counted when somebody asks; a tick only finds the bin, in a quarter of the instructions.
pub struct Durations(Box<[u32]>);

impl Durations {
    /// Allocates all it will ever need. Not real-time.
    #[must_use]
    pub fn new() -> Self {
        Self(vec![0; bin_of(LONGEST_NS) + 1].into())
    }

    /// Counts one duration. Real-time: bounded, no allocation.
    #[inline]
    pub fn record(&mut self, duration_ns: u64) {
        if let Some(count) = self.0.get_mut(bin_of(duration_ns.min(LONGEST_NS))) {
            *count = count.saturating_add(1);
        }
    }

    /// Every bin that counted something: its duration, ns, and how often. Not real-time.
    #[must_use]
    pub fn bins(&self) -> Vec<(u64, u64)> {
        self.histogram()
            .iter_recorded()
            .map(|bin| (bin.value_iterated_to(), bin.count_since_last_iteration()))
            .collect()
    }

    /// The percentiles so far. Not real-time.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        let histogram = self.histogram();
        Percentiles {
            p50: histogram.value_at_quantile(0.5),
            p99: histogram.value_at_quantile(0.99),
            p999: histogram.value_at_quantile(0.999),
            max: histogram.max(),
        }
    }

    fn histogram(&self) -> Histogram<u32> {
        // The arguments are constants that satisfy the constructor's conditions (low >= 1, high >= 2 low, digits <= 5).
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS);
        let mut histogram = histogram.unwrap_or_else(|_| unreachable!("constant, legal bounds"));
        for (bin, count) in self.0.iter().enumerate().filter(|(_, count)| **count > 0) {
            histogram.saturating_record_n(shortest_in(bin), *count);
        }
        histogram
    }
}

/// Bins of each doubling of the duration: two decimal digits need 100, rounded up to a power of two.
const BINS_LOG2: u32 = 7;

/// Which bin a duration falls into: below 256 ns each has its own, above there are 128 to a doubling.
#[inline]
#[allow(clippy::cast_possible_truncation)] // the result is at most the bin of the longest time, some 4000
fn bin_of(duration_ns: u64) -> usize {
    let doublings = (duration_ns | 1 << BINS_LOG2).ilog2() - BINS_LOG2;
    ((u64::from(doublings) << BINS_LOG2) + (duration_ns >> doublings)) as usize
}

/// The shortest duration of a bin, ns.
fn shortest_in(bin: usize) -> u64 {
    let doublings = (bin as u64 >> BINS_LOG2).saturating_sub(1);
    (bin as u64 - (doublings << BINS_LOG2)) << doublings
}

impl Default for Durations {
    fn default() -> Self {
        Self::new()
    }
}

/// Where the time of a tick goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading the device.
    Read,
    /// Mapping and stepping the models.
    Models,
    /// Limiting.
    Envelope,
    /// Writing the device.
    Write,
}

/// Every how many ticks the stages are timed: four looks at the stopwatch cost as much as a stage.
pub(super) const STAGE_SAMPLING: u64 = 16;

/// All that is measured of a loop.
#[derive(Default)]
pub struct Timing {
    /// Start of a tick after its deadline.
    pub lateness: Durations,
    /// A whole tick.
    pub compute: Durations,
    /// Stages, in the order of [`Stage`].
    pub stages: [Durations; 4],
    /// Ticks run.
    pub ticks: u64,
    /// Ticks that started later than a tenth of the period.
    pub late: u64,
    /// Ticks that were skipped because their whole period had passed.
    pub missed: u64,
}

impl Timing {
    /// Counts a stage. Real-time: bounded, no allocation.
    #[inline]
    pub fn stage(&mut self, stage: Stage, duration_ns: u64) {
        if let Some(durations) = self.stages.get_mut(stage as usize) {
            durations.record(duration_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bins are those of the library's histogram: whatever is recorded, both say the same of it.
    #[test]
    fn a_duration_is_counted_as_the_library_counts_it() {
        let mut library = Histogram::<u32>::new_with_bounds(1, LONGEST_NS, DIGITS).expect("legal bounds");
        let mut durations = Durations::new();
        let edges = (0..40).flat_map(|power| [-1, 0, 1].map(|by| (1_u64 << power).saturating_add_signed(by)));
        let spread = (0..200_000_u64).map(|k| k * k * k % 150_000_000_000);
        for duration_ns in edges.chain(0..1000).chain(spread).chain([u64::MAX]) {
            library.saturating_record(duration_ns.min(LONGEST_NS));
            durations.record(duration_ns);
        }
        let bins: Vec<(u64, u64)> = library
            .iter_recorded()
            .map(|bin| (bin.value_iterated_to(), bin.count_since_last_iteration()))
            .collect();
        assert_eq!(durations.bins(), bins);
        let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|quantile| library.value_at_quantile(quantile));
        assert_eq!(durations.percentiles(), Percentiles { p50, p99, p999, max: library.max() });
    }
}
