//! Devices of a run: history of each device, and the device chosen for numbers and traces.

use crate::event_counts::EventCounts;
use crate::scene::ArrowScale;
use flotor_core::trace::{Events, TickRecord};
use flotor_history::{History, Sample};

/// Histories of the devices of a run, in the scene's order; never empty.
#[derive(Clone, Debug)]
pub struct Devices {
    seen: Vec<Seen>,
    chosen: usize,
}

#[derive(Clone, Debug)]
struct Seen {
    name: String,
    history: History,
    event_counts: EventCounts,
}

impl Devices {
    /// Creates a device for each history; without any, one device without samples.
    #[must_use]
    pub fn new(histories: Vec<History>) -> Self {
        let seen = |history: History| {
            let name = history.device_name().to_owned();
            Seen { name, event_counts: EventCounts::of(history.samples()), history }
        };
        let mut seen: Vec<Seen> = histories.into_iter().map(seen).collect();
        if seen.is_empty() {
            let history = History::default();
            seen.push(Seen { name: String::new(), event_counts: EventCounts::default(), history });
        }
        Self { seen, chosen: 0 }
    }

    /// Returns the number of devices.
    #[must_use]
    pub fn count(&self) -> usize {
        self.seen.len()
    }

    /// Returns the names of the devices.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.seen.iter().map(|seen| seen.name.as_str())
    }

    /// Returns the number of the chosen device, from 0.
    #[must_use]
    pub fn chosen(&self) -> usize {
        self.chosen
    }

    /// Chooses a device, and ignores the number of an absent device; returns true if the choice has changed.
    pub fn choose(&mut self, number: usize) -> bool {
        let is_another = number < self.seen.len() && number != self.chosen;
        if is_another {
            self.chosen = number;
        }
        is_another
    }

    /// Returns the name of the chosen device; `None` for a single device.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.seen.get(self.chosen).filter(|_| self.seen.len() > 1).map(|seen| seen.name.as_str())
    }

    /// Returns the history of the chosen device.
    #[must_use]
    pub fn history(&self) -> &History {
        &self.seen[self.chosen.min(self.seen.len() - 1)].history
    }

    /// Returns the event counts of the chosen device.
    #[must_use]
    pub fn event_counts(&self) -> &EventCounts {
        &self.seen[self.chosen.min(self.seen.len() - 1)].event_counts
    }

    /// Returns name and history of each device.
    pub fn all(&self) -> impl Iterator<Item = (&str, &History)> {
        self.seen.iter().map(|seen| (seen.name.as_str(), &seen.history))
    }

    /// Returns the sample of each device at a time, s, in order; `None` until every device has a sample.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Vec<Sample>> {
        self.seen.iter().map(|seen| seen.history.at(time_s).copied()).collect()
    }

    /// Returns a scale of arrows that fits all samples of all devices.
    pub fn scale(&self) -> ArrowScale {
        let scales = self.seen.iter().map(|seen| seen.event_counts.scale());
        scales.fold(ArrowScale::default(), ArrowScale::larger)
    }

    /// Returns the events in the newest ticks of all devices.
    pub fn newest_events(&self) -> Events {
        let newest = self.seen.iter().filter_map(|seen| seen.history.at(f64::INFINITY));
        newest.fold(Events::NONE, |mut events, sample| {
            events.insert(sample.events);
            events
        })
    }

    /// Adds a tick to the history and the event counts of its device; ignores a tick of an unknown device.
    pub fn push(&mut self, record: &TickRecord) {
        if let Some(seen) = self.seen.get_mut(usize::from(record.device)) {
            seen.history.push(record);
            seen.event_counts.add(&Sample::from(record));
        }
    }

    /// Adds a change of a parameter at a time, ns, to the history of each device.
    pub fn push_change(&mut self, time_ns: u64, parameter: &str) {
        self.seen.iter_mut().for_each(|seen| seen.history.push_change(time_ns, parameter));
    }

    /// Sets the number of dropped ticks.
    pub fn set_dropped(&mut self, dropped: u64) {
        self.seen.iter_mut().for_each(|seen| seen.event_counts.dropped = dropped);
    }
}
