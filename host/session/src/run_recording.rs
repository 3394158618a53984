//! Recording of a run, which continues if the recording fails.

use crate::Observer;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::{Note, RecordError, Recorder};

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
