//! The devices of a run: what has been seen of each, and which one numbers and traces are of.

use crate::scene::ArrowScale;
use crate::tally::Tally;
use flotor_core::trace::{Events, TickRecord};
use flotor_history::{History, Sample};

/// What has been seen of the devices of a run, in the scene's order. There is always one.
#[derive(Clone, Debug)]
pub struct Devices {
    seen: Vec<Seen>,
    chosen: usize,
}

#[derive(Clone, Debug)]
struct Seen {
    name: String,
    history: History,
    tally: Tally,
}

impl Devices {
    /// Of a device each; without any, of one of which nothing has been seen.
    #[must_use]
    pub fn new(histories: Vec<History>) -> Self {
        let seen = |history: History| {
            let name = history.device_name().to_owned();
            Seen { name, tally: Tally::of(history.samples()), history }
        };
        let mut seen: Vec<Seen> = histories.into_iter().map(seen).collect();
        if seen.is_empty() {
            let history = History::default();
            seen.push(Seen { name: String::new(), tally: Tally::default(), history });
        }
        Self { seen, chosen: 0 }
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.seen.len()
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.seen.iter().map(|seen| seen.name.as_str())
    }

    /// Number of the chosen one.
    #[must_use]
    pub fn chosen(&self) -> usize {
        self.chosen
    }

    /// Chooses one; whether it is another than before.
    pub fn choose(&mut self, number: usize) -> bool {
        let is_another = number < self.seen.len() && number != self.chosen;
        if is_another {
            self.chosen = number;
        }
        is_another
    }

    /// Name of the chosen one, where there are several.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.seen.get(self.chosen).filter(|_| self.seen.len() > 1).map(|seen| seen.name.as_str())
    }

    /// What has been seen of the chosen one.
    #[must_use]
    pub fn history(&self) -> &History {
        &self.seen[self.chosen.min(self.seen.len() - 1)].history
    }

    /// What has happened to the chosen one.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.seen[self.chosen.min(self.seen.len() - 1)].tally
    }

    /// What has been seen of each, with its name.
    pub fn all(&self) -> impl Iterator<Item = (&str, &History)> {
        self.seen.iter().map(|seen| (seen.name.as_str(), &seen.history))
    }

    /// The sample of each device at a time, in order; none before the first tick of all of them.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Vec<Sample>> {
        self.seen.iter().map(|seen| seen.history.at(time_s).copied()).collect()
    }

    /// Lengths of arrows that fit everything seen of all.
    #[must_use]
    pub fn scale(&self) -> ArrowScale {
        let scales = self.seen.iter().map(|seen| seen.tally.scale());
        scales.reduce(ArrowScale::larger).unwrap_or_else(|| ArrowScale::fitting(std::iter::empty()))
    }

    /// What happened in the newest tick of any.
    #[must_use]
    pub fn newest_events(&self) -> Events {
        let newest = self.seen.iter().filter_map(|seen| seen.history.at(f64::INFINITY));
        newest.fold(Events::NONE, |mut events, sample| {
            events.insert(sample.events);
            events
        })
    }

    /// Takes a tick in.
    pub fn push(&mut self, record: &TickRecord) {
        if let Some(seen) = self.seen.get_mut(usize::from(record.device)) {
            seen.history.push(record);
            seen.tally.add(&Sample::from(record));
        }
    }

    /// Adds a change of a parameter at a time, ns, to what has been seen of each device.
    pub fn push_change(&mut self, time_ns: u64, parameter: &str) {
        self.seen.iter_mut().for_each(|seen| seen.history.push_change(time_ns, parameter));
    }

    /// So many ticks found no room on the way.
    pub fn set_dropped(&mut self, dropped: u64) {
        self.seen.iter_mut().for_each(|seen| seen.tally.dropped = dropped);
    }
}
