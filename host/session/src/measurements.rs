//! Measurements of a run for its report, and its recording, without which the run continues.

use crate::scene::Scene;
use crate::summary::{RunFacts, Tally};
use crate::{Observer, PluginReport, RunOptions};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::{Note, RecordError, Recorder, TraceDigest};

/// Observer that measures a run for its report.
pub struct Measurements {
    /// Tick statistics.
    pub tally: Tally,
    /// Recording of the run, if one is requested.
    pub recording: RunRecording,
    digest: TraceDigest,
    requested: Demand,
}

impl Measurements {
    /// Creates the measurements before a run; `requested` are the model outputs to compute beside those that are recorded.
    #[must_use]
    pub fn new(recorder: Option<Recorder>, requested: Demand) -> Self {
        let (tally, digest) = (Tally::default(), TraceDigest::new());
        Self { tally, recording: RunRecording::new(recorder), digest, requested }
    }

    /// Returns the inputs of the summary so far, without messages between hosts; called before the recording is finished.
    #[must_use]
    pub fn facts<'a>(
        &self,
        scene: &'a Scene,
        options: &'a RunOptions,
        plugins: &'a [PluginReport],
    ) -> RunFacts<'a> {
        let (requested, trace_digest) = (self.demand(), self.digest.finish());
        RunFacts { scene, options, plugins, requested, carried: &[], trace_digest }
    }
}

impl Observer for Measurements {
    fn change(&mut self, change: &Change) {
        self.recording.change(change);
    }

    fn observe(&mut self, record: &TickRecord) {
        self.tally.observe(record);
        self.digest.update(record);
        self.recording.observe(record);
    }

    fn demand(&self) -> Demand {
        self.requested.with(self.recording.demand())
    }
}

/// Recording of a run, if one is requested. A failing disk ends the recording, not the run. Not real-time.
#[derive(Default)]
pub struct RunRecording {
    recorder: Option<Recorder>,
    failure: Option<RecordError>,
    has_ticks: bool,
}

impl RunRecording {
    /// Creates the recording of a run; without a recorder nothing is recorded.
    #[must_use]
    pub fn new(recorder: Option<Recorder>) -> Self {
        Self { recorder, failure: None, has_ticks: false }
    }

    /// Returns true while the recording is not finished.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.recorder.is_some()
    }

    /// Finishes the recording with these notes. Removes the file if the run ended before its first tick: the next run can then
    /// record under the same name.
    ///
    /// # Errors
    /// The error that ended the recording, during the run or now.
    pub fn finish(&mut self, notes: &[Note]) -> Result<(), RecordError> {
        let Some(mut recorder) = self.recorder.take() else { return Ok(()) };
        self.failure.take().map_or(Ok(()), Err)?;
        if !self.has_ticks {
            recorder.discard();
            return Ok(());
        }
        notes.iter().try_for_each(|note| recorder.note(note))?;
        recorder.finish()
    }

    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordError>) {
        if self.failure.is_none()
            && let Some(recorder) = &mut self.recorder
        {
            self.failure = write(recorder).err();
        }
    }
}

impl Observer for RunRecording {
    fn change(&mut self, change: &Change) {
        self.write(|recorder| recorder.change(change));
    }

    /// Returns all outputs that a recording stores, until it fails or ends.
    fn demand(&self) -> Demand {
        if self.is_on() && self.failure.is_none() { Demand::ALL } else { Demand::FORCE }
    }

    fn observe(&mut self, record: &TickRecord) {
        self.has_ticks = true;
        self.write(|recorder| recorder.record(record));
    }
}
