//! Timing statistics of the loop: histograms of lateness and compute time, in fixed memory, always recorded.

use hdrhistogram::Histogram;
use serde::Serialize;

/// Upper limit of a histogram, ns; longer times count as this limit.
const LONGEST_NS: u64 = 100_000_000_000;

/// Two significant digits: a bin is at most 1 % wide, and the whole histogram is some 16 kB.
const DIGITS: u8 = 2;

/// Percentiles of one histogram, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Percentiles {
    /// Median, ns.
    pub p50: u64,
    /// 99th percentile, ns.
    pub p99: u64,
    /// 99.9th percentile, ns.
    pub p999: u64,
    /// Largest value, ns.
    pub max: u64,
}

/// Histogram of durations, ns.
pub struct Durations(Histogram<u32>);

impl Durations {
    /// Creates an empty histogram with preallocated memory. Not real-time.
    #[must_use]
    pub fn new() -> Self {
        // The arguments are constants that satisfy the constructor's conditions (low >= 1, high >= 2 low, digits <= 5).
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, DIGITS);
        Self(histogram.unwrap_or_else(|_| unreachable!("constant, legal bounds")))
    }

    /// Counts one duration; a duration above 100 s counts as 100 s. Real-time: bounded, no allocation.
    pub fn record(&mut self, duration_ns: u64) {
        self.0.saturating_record(duration_ns.min(LONGEST_NS));
    }

    /// Returns the non-empty bins, each as its largest duration, ns, and its count. Not real-time.
    #[must_use]
    pub fn bins(&self) -> Vec<(u64, u64)> {
        let bins = self.0.iter_recorded();
        bins.map(|bin| (bin.value_iterated_to(), bin.count_since_last_iteration())).collect()
    }

    /// Returns the percentiles so far. Not real-time.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        Percentiles {
            p50: self.0.value_at_quantile(0.5),
            p99: self.0.value_at_quantile(0.99),
            p999: self.0.value_at_quantile(0.999),
            max: self.0.max(),
        }
    }
}

impl Default for Durations {
    fn default() -> Self {
        Self::new()
    }
}

/// Stage of a tick with a histogram of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Applying parameter changes, and reading the devices.
    Read,
    /// Mapping and stepping the models.
    Models,
    /// Limiting the wrenches.
    Envelope,
    /// Writing the commands to the devices.
    Write,
}

/// Sampling interval of the stages, ticks: four readings of the stage timer cost as much as a stage.
pub(super) const STAGE_SAMPLING: u64 = 16;

/// Timing statistics of a loop.
#[derive(Default)]
pub struct Timing {
    /// Delays of the ticks after their deadlines; empty on the virtual clock.
    pub lateness: Durations,
    /// Compute times of whole ticks, without the wait before.
    pub compute: Durations,
    /// Durations of the stages in every 16th tick, in the order of [`Stage`].
    pub stages: [Durations; 4],
    /// Number of ticks.
    pub ticks: u64,
    /// Number of ticks that started late by more than a tenth of the period.
    pub late: u64,
    /// Number of ticks that were skipped because their whole period had passed.
    pub missed: u64,
}

impl Timing {
    /// Records the duration of a stage. Real-time: bounded, no allocation.
    #[inline]
    pub fn stage(&mut self, stage: Stage, duration_ns: u64) {
        if let Some(durations) = self.stages.get_mut(stage as usize) {
            durations.record(duration_ns);
        }
    }
}
