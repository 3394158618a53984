//! Measurements of a run for its summary, and its recording; a failed recording does not end the run.

use crate::scene::Scene;
use crate::summary::{RunFacts, Tally};
use crate::{Observer, PluginReport, RunOptions};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::{Note, RecordError, Recorder, TraceDigest};

/// Observer that collects tick statistics and trace digest for the summary of a run, and records the run.
pub struct Measurements {
    /// Tick statistics for the summary.
    pub tally: Tally,
    /// Recording of the run; records nothing if none was requested.
    pub recording: RunRecording,
    digest: TraceDigest,
    requested: Demand,
}

impl Measurements {
    /// Creates the measurements before a run; `requested` are the model outputs to compute in addition to the recorded outputs.
    /// Without `recorder` the run is not recorded.
    #[must_use]
    pub fn new(recorder: Option<Recorder>, requested: Demand) -> Self {
        let (tally, digest) = (Tally::default(), TraceDigest::new());
        Self { tally, recording: RunRecording::new(recorder), digest, requested }
    }

    /// Returns the inputs of the summary, without the counts of messages between hosts. Call this function before the recording is
    /// finished, because the demand changes then.
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
        self.tally.add(record);
        self.digest.update(record);
        self.recording.observe(record);
    }

    fn demand(&self) -> Demand {
        self.requested.with(self.recording.demand())
    }
}

/// Recording of a run, if one is requested. A write error ends the recording, not the run. Not real-time.
#[derive(Default)]
pub struct RunRecording {
    /// Recorder, or the write error that ended the recording; `None` if no recording was requested, or it is finished.
    recorder: Option<Result<Recorder, RecordError>>,
    has_ticks: bool,
}

impl RunRecording {
    /// Creates the recording of a run; `None`: the run is not recorded.
    #[must_use]
    pub fn new(recorder: Option<Recorder>) -> Self {
        Self { recorder: recorder.map(Ok), has_ticks: false }
    }

    /// Returns true if a recording was requested and is not finished; also after a write error.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.recorder.is_some()
    }

    /// Finishes the recording with these notes. Removes the file if the run ended before its first tick: the next run can then
    /// record under the same name.
    ///
    /// # Errors
    /// The write error that ended the recording, during the run or now.
    pub fn finish(&mut self, notes: &[Note]) -> Result<(), RecordError> {
        let Some(mut recorder) = self.recorder.take().transpose()? else { return Ok(()) };
        if !self.has_ticks {
            recorder.discard();
            return Ok(());
        }
        notes.iter().try_for_each(|note| recorder.note(note))?;
        recorder.finish()
    }

    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordError>) {
        if let Some(Ok(recorder)) = &mut self.recorder
            && let Err(failure) = write(recorder)
        {
            self.recorder = Some(Err(failure));
        }
    }
}

impl Observer for RunRecording {
    fn change(&mut self, change: &Change) {
        self.write(|recorder| recorder.change(change));
    }

    /// Returns all outputs while the recording writes, the force alone otherwise.
    fn demand(&self) -> Demand {
        if let Some(Ok(_)) = self.recorder { Demand::ALL } else { Demand::FORCE }
    }

    fn observe(&mut self, record: &TickRecord) {
        self.has_ticks = true;
        self.write(|recorder| recorder.record(record));
    }
}
