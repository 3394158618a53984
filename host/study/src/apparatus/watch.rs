//! What is taken down of a presentation: measures of the movement, and the whole of it in a recording.

use crate::kinematics::{KinematicsMeter, Sample};
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_session::{Observer, RunRecording};

/// Looks at every tick of a study.
#[derive(Default)]
pub(super) struct Watch {
    /// Runs while a stimulus is being felt.
    pub(super) meter: Option<KinematicsMeter>,
    /// Of the trial under way.
    pub(super) recording: RunRecording,
    /// Ticks missed since somebody asked.
    pub(super) missed_ticks: u64,
    /// Whether the handle was out of its range in the last tick.
    pub(super) out_of_range: bool,
    /// A change of the stimulus that the model did not take: its name and value.
    pub(super) refused: Option<String>,
}

impl Observer for Watch {
    fn observe(&mut self, record: &TickRecord) {
        self.out_of_range = record.events.intersects(Events::BOUNDARY);
        self.missed_ticks += u64::from(record.events.intersects(Events::MISSED));
        if let Some(meter) = &mut self.meter {
            meter.take(&sample(record));
        }
        self.recording.observe(record);
    }

    fn change(&mut self, change: &Change) {
        if change.outcome != ChangeOutcome::Applied {
            self.refused = Some(format!("{}.{} = {}", change.plugin, change.parameter, change.value));
        }
        self.recording.change(change);
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
