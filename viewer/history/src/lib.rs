//! History of a run: its description, and samples of its ticks in order.
//!
//! - [`quantity`]: quantities of a sample that can be plotted.
//! - [`derived`]: stiffness felt, force over position.
//! - [`decimate`]: decimation of traces.
//! - [`player`]: playback; [`compared`]: a second recording over a run.
//!
//! Not real-time.

pub mod compared;
pub mod decimate;
pub mod derived;
pub mod player;
pub mod quantity;
mod sample;

pub use sample::{Sample, seconds};

use crate::derived::felt_stiffness_n_per_m;
use flotor_core::guidance::is_guidance;
use flotor_core::trace::TickRecord;
use flotor_core::{ChangeOutcome, Clock};
use flotor_record::{Note, ReadError, Recording, RunDescription};
use std::collections::VecDeque;
use std::path::Path;

/// Returns a placeholder for an unknown run: 1000 Hz, no plugins.
#[must_use]
pub fn unknown_run() -> RunDescription {
    RunDescription {
        flotor_version: String::new(),
        rate_hz: 1000.0,
        duration_s: 0.0,
        seed: 0,
        clock: Clock::Real,
        scene_toml: String::new(),
        plugins: Vec::new(),
        couplings: Vec::new(),
    }
}

/// Retention of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retention {
    /// All samples, for a recording.
    All,
    /// Number of newest samples, for a running host.
    Newest(usize),
}

/// Samples of a device in order of time, and the description of the run.
#[derive(Clone, Debug)]
pub struct History {
    run: RunDescription,
    samples: VecDeque<Sample>,
    forgotten: u64,
    retention: Retention,
    notes: Vec<Note>,
    /// Times of the changes of parameters, s, in order.
    changes_s: VecDeque<f64>,
    device: u16,
}

impl Default for History {
    /// Returns the history of an unknown run, without samples.
    fn default() -> Self {
        Self::new(unknown_run(), Retention::Newest(1))
    }
}

impl History {
    /// Creates an empty history for the first device of a run.
    #[must_use]
    pub fn new(run: RunDescription, retention: Retention) -> Self {
        let capacity = if let Retention::Newest(count) = retention { count } else { 0 };
        let samples = VecDeque::with_capacity(capacity);
        Self {
            run,
            samples,
            forgotten: 0,
            retention,
            notes: Vec::new(),
            changes_s: VecDeque::new(),
            device: 0,
        }
    }

    /// Creates an empty history for each device of a run.
    #[must_use]
    pub fn of_each_device(run: &RunDescription, retention: Retention) -> Vec<Self> {
        let count = u16::try_from(run.devices().count()).unwrap_or(u16::MAX).max(1);
        (0..count).map(|device| Self { device, ..Self::new(run.clone(), retention) }).collect()
    }

    /// Reads the history of each device from a recording. If the file is damaged after the first tick, the ticks before the damage are
    /// kept, and a note describes the damage.
    ///
    /// # Errors
    /// [`ReadError`] if no part of the file is usable.
    pub fn read(path: &Path) -> Result<Vec<Self>, ReadError> {
        let mut recording = Recording::open(path)?;
        let mut histories = Self::of_each_device(recording.run(), Retention::All);
        let (mut damage, mut last_ns) = (None, None);
        while let Some(tick) = recording.next() {
            match tick {
                Ok(record) => {
                    last_ns = Some(record.time_ns);
                    histories.iter_mut().for_each(|history| history.push(&record));
                    let changes = recording.take_changes();
                    let applied = changes.iter().filter(|change| change.outcome == ChangeOutcome::Applied);
                    for change in applied {
                        histories
                            .iter_mut()
                            .for_each(|history| history.push_change(change.time_ns, &change.parameter));
                    }
                }
                Err(error) if last_ns.is_none() => return Err(error),
                Err(error) => damage = Some(error.to_string()),
            }
        }
        let mut notes = recording.notes().to_vec();
        if let Some(text) = damage {
            let severity = flotor_record::Severity::Error;
            let time_ns = last_ns.unwrap_or_default();
            notes.push(Note { time_ns, severity, source: "recording".to_owned(), text });
        }
        histories.iter_mut().for_each(|history| history.notes.clone_from(&notes));
        Ok(histories)
    }

    /// Returns the number of the device, from 0 in the order of the scene.
    #[must_use]
    pub fn device(&self) -> u16 {
        self.device
    }

    /// Returns the name of the device in the scene; empty if the run has no such device.
    #[must_use]
    pub fn device_name(&self) -> &str {
        self.run.devices().nth(usize::from(self.device)).map_or("", |device| device.name.as_str())
    }

    /// Adds a tick of this device with its felt stiffness, and ignores ticks of other devices; at the limit of retained samples,
    /// removes the oldest sample.
    pub fn push(&mut self, record: &TickRecord) {
        if record.device != self.device {
            return;
        }
        if let Retention::Newest(count) = self.retention {
            while self.samples.len() >= count.max(1) {
                self.samples.pop_front();
                self.forgotten += 1;
            }
        }
        /// Number of earlier samples searched for the stiffness: about 0.1 s.
        const LOOKED_AT: usize = 100;
        let mut sample = Sample::from(record);
        let earlier = self.samples.iter().rev().take(LOOKED_AT);
        #[allow(clippy::cast_possible_truncation)] // for pictures
        let stiffness = felt_stiffness_n_per_m(earlier, &sample) as f32;
        sample.stiffness_n_per_m = stiffness;
        self.samples.push_back(sample);
    }

    /// Adds the time of a parameter change, not earlier than the last change, and removes the changes before the first retained
    /// sample. Ignores a change that guides a hand, because each motion of a pointer sends such a change.
    pub fn push_change(&mut self, time_ns: u64, parameter: &str) {
        let [first_s, _] = self.span_s();
        while self.retention != Retention::All
            && self.changes_s.front().is_some_and(|time_s| *time_s < first_s)
        {
            self.changes_s.pop_front();
        }
        if !is_guidance(parameter) {
            self.changes_s.push_back(seconds(time_ns));
        }
    }

    /// Returns the times of the changes of parameters between two times, s, both included, without changes that guide a hand.
    pub fn changes_between_s(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> {
        let start = self.changes_s.partition_point(|time_s| *time_s < from_s);
        let end = self.changes_s.partition_point(|time_s| *time_s <= to_s).max(start);
        self.changes_s.range(start..end).copied()
    }

    /// Returns the description of the run.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// Returns the notes of the run.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Returns the number of retained samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Returns true if there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Returns the times of the first and last sample, s; both 0 without samples.
    #[must_use]
    pub fn span_s(&self) -> [f64; 2] {
        [self.samples.front(), self.samples.back()].map(|sample| sample.map_or(0.0, Sample::time_s))
    }

    /// Returns the sample valid at a time, s: the last sample not after the time, or else the first sample; `None` without samples.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<&Sample> {
        let after = self.index_after(time_s);
        self.samples.get(after.saturating_sub(1))
    }

    /// Returns the longest interval between two samples of a continuous run, s; a longer interval is a gap.
    #[must_use]
    pub fn gap_s(&self) -> f64 {
        /// Duration of a few pictures; a shorter gap is invisible.
        const LEAST_S: f64 = 0.05;
        (20.0 / self.run.rate_hz.max(1.0e-3)).max(LEAST_S)
    }

    /// Returns the sample valid at a time, s; `None` before the first sample and in a gap.
    #[must_use]
    pub fn seen_at(&self, time_s: f64) -> Option<&Sample> {
        let sample = self.at(time_s)?;
        // The last sample is valid for all later times.
        let is_last = self.samples.back().is_some_and(|last| last.time_ns == sample.time_ns);
        let age_s = time_s - sample.time_s();
        (age_s >= 0.0 && (is_last || age_s <= self.gap_s())).then_some(sample)
    }

    /// Returns the tick rate of the loop in the second up to a time, Hz: a missed tick does not count, a tick without a sample
    /// does. `None` with fewer than two samples in this second.
    #[must_use]
    pub fn tick_rate_hz(&self, now_s: f64) -> Option<f64> {
        const OVER_S: f64 = 1.0;
        let mut samples = self.between(now_s - OVER_S, now_s);
        let (first, last) = (samples.next()?, samples.next_back()?);
        let span_s = last.time_s() - first.time_s();
        (span_s > 0.0).then(|| (last.tick - first.tick) as f64 / span_s)
    }

    /// Returns the samples between two times, s, both included.
    pub fn between(&self, from_s: f64, to_s: f64) -> impl DoubleEndedIterator<Item = &Sample> {
        let start = self.samples.partition_point(|sample| sample.time_s() < from_s);
        let end = self.index_after(to_s).max(start);
        self.samples.range(start..end)
    }

    /// Returns the number of the first sample at or after a time, s. Removed samples are counted as well, so that the number of a
    /// sample never changes.
    #[must_use]
    pub fn number_at(&self, time_s: f64) -> u64 {
        self.forgotten + self.samples.partition_point(|sample| sample.time_s() < time_s) as u64
    }

    /// Returns the retained samples from a number on.
    pub fn from_number(&self, number: u64) -> impl Iterator<Item = &Sample> {
        let skipped = usize::try_from(number.saturating_sub(self.forgotten)).unwrap_or(usize::MAX);
        self.samples.range(skipped.min(self.samples.len())..)
    }

    /// Returns all retained samples.
    pub fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter()
    }

    /// Returns the sample with the largest force; `None` without samples.
    #[must_use]
    pub fn strongest(&self) -> Option<&Sample> {
        self.samples
            .iter()
            .max_by(|a, b| a.force_n().length_squared().total_cmp(&b.force_n().length_squared()))
    }

    fn index_after(&self, time_s: f64) -> usize {
        self.samples.partition_point(|sample| sample.time_s() <= time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::RECORD_WORDS;
    use flotor_sync::Words;

    #[test]
    fn the_rate_counts_ticks_without_a_sample_and_leaves_out_missed_ones() {
        // Of a loop of 2 kHz every second tick has a sample, and after each eight ticks two are missed.
        let mut history = History::new(unknown_run(), Retention::All);
        for tick in (0..8000).step_by(2) {
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            (record.tick, record.time_ns) = (tick, (tick + tick / 8 * 2) * 500_000);
            history.push(&record);
        }
        let rate_hz = history.tick_rate_hz(4.0).expect("there are many ticks");
        // The second begins anywhere among ten periods, so two ticks may be missing.
        assert!((rate_hz - 1600.0).abs() <= 2.0, "{rate_hz} Hz");
        assert_eq!([history.tick_rate_hz(-1.0), history.tick_rate_hz(0.0)], [None; 2]);
    }

    #[test]
    fn changes_that_guide_a_hand_are_left_out_and_those_of_forgotten_ticks_go() {
        let mut history = History::new(unknown_run(), Retention::Newest(1000));
        for tick in 0..3000 {
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            (record.tick, record.time_ns) = (tick, tick * 1_000_000);
            history.push(&record);
            let parameter = if tick % 500 == 0 { "gamma_n" } else { "hand_target_z_mm" };
            history.push_change(record.time_ns, parameter);
        }
        assert_eq!(history.changes_between_s(0.0, 3.0).collect::<Vec<_>>(), [2.0, 2.5]);
        assert_eq!(history.changes_between_s(2.0, 2.4).collect::<Vec<_>>(), [2.0]);
        assert_eq!(history.changes_between_s(2.6, 2.1).count(), 0);
    }
}
