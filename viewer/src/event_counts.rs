//! Counts of a run's events so far, and a scale of arrows for its largest wrench.

use crate::scene::ArrowScale;
use flotor_core::trace::Events;
use flotor_history::Sample;

/// Counts of events since the first sample, and a scale of arrows for the largest wrench.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventCounts {
    counts: [u64; Events::NAMES.len()],
    scale: ArrowScale,
    since_s: Option<f64>,
    /// Number of dropped ticks.
    pub dropped: u64,
}

impl EventCounts {
    /// Counts all samples of a recording.
    #[must_use]
    pub fn of<'a>(samples: impl Iterator<Item = &'a Sample>) -> Self {
        let mut event_counts = Self::default();
        samples.for_each(|sample| event_counts.add(sample));
        event_counts
    }

    /// Counts the events of a sample, and enlarges the scale of arrows to fit its wrench.
    pub fn add(&mut self, sample: &Sample) {
        self.since_s.get_or_insert(sample.time_s());
        let bits = sample.events.bits();
        for (bit, count) in self.counts.iter_mut().enumerate() {
            *count += u64::from(bits >> bit & 1);
        }
        self.scale = self.scale.with(sample);
    }

    /// Returns the number of ticks with each event, indexed by the event's bit.
    #[must_use]
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Returns the time of the first sample, s: a window that opens during a run has no earlier samples. 0 without samples.
    #[must_use]
    pub fn since_s(&self) -> f64 {
        self.since_s.unwrap_or(0.0)
    }

    /// Returns a scale of arrows that fits all samples.
    pub fn scale(&self) -> ArrowScale {
        self.scale
    }
}
