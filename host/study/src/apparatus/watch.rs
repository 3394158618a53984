//! What is taken down of a presentation: measures of the movement, and the whole of it in a recording.

use crate::kinematics::{KinematicsMeter, Sample};
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_record::{RecordError, Recorder};
use flotor_session::Observer;

/// Looks at every tick of a study.
#[derive(Default)]
pub(super) struct Watch {
    /// Runs while a stimulus is being felt.
    pub(super) meter: Option<KinematicsMeter>,
    /// Of the trial under way.
    pub(super) recorder: Option<Recorder>,
    /// Ticks missed since somebody asked.
    pub(super) missed_ticks: u64,
    /// Whether the handle was out of its range in the last tick.
    pub(super) out_of_range: bool,
    /// A change of the stimulus that the model did not take: its name and value.
    pub(super) refused: Option<String>,
    pub(super) failure: Option<RecordError>,
}

impl Watch {
    /// Ends the recording of a trial.
    pub(super) fn finish_recording(&mut self) -> Result<(), RecordError> {
        let finished = self.recorder.take().map_or(Ok(()), Recorder::finish);
        self.failure.take().map_or(finished, Err)
    }

    fn write(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordError>) {
        if self.failure.is_none()
            && let Some(recorder) = &mut self.recorder
        {
            self.failure = write(recorder).err();
        }
    }
}

impl Observer for Watch {
    fn observe(&mut self, record: &TickRecord) {
        self.out_of_range = record.events.intersects(Events::BOUNDARY);
        self.missed_ticks += u64::from(record.events.intersects(Events::MISSED));
        if let Some(meter) = &mut self.meter {
            meter.take(&sample(record));
        }
        self.write(|recorder| recorder.record(record));
    }

    fn change(&mut self, change: &Change) {
        if change.outcome != ChangeOutcome::Applied {
            self.refused = Some(format!("{}.{} = {}", change.plugin, change.parameter, change.value));
        }
        self.write(|recorder| recorder.change(change));
    }
}

/// What a tick says of handle and force along the vertical.
#[must_use]
pub fn sample(record: &TickRecord) -> Sample {
    Sample {
        dt_s: record.dt_ns as f64 * 1.0e-9,
        z_m: record.pose.position().z,
        velocity_m_per_s: record.twist.linear().z,
        force_z_n: record.commanded.force().z,
        force_n: record.commanded.force().length(),
        out_of_range: record.events.intersects(Events::BOUNDARY),
    }
}
