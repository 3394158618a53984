//! What is taken down of a presentation: measures of the movement, and the whole of it in a recording.

use crate::kinematics::{KinematicsMeter, Sample};
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_hal::Demand;
use flotor_session::{Observer, RunRecording};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Looks at every tick of a study.
#[derive(Default)]
pub struct Watch {
    /// Runs while a stimulus is being felt.
    pub meter: Option<KinematicsMeter>,
    /// Of the trial under way.
    pub recording: RunRecording,
    /// Outputs of the models that recordings of later trials store: the loop takes up a request some ticks later.
    pub ahead: Option<Demand>,
    /// Ticks missed since somebody asked.
    pub missed_ticks: u64,
    /// Whether the handle was out of its range in the last tick.
    pub out_of_range: bool,
    /// A change of the stimulus that the model did not take.
    pub refused: Option<Change>,
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

    fn demand(&self) -> Demand {
        self.ahead.unwrap_or(Demand::FORCE).with(self.recording.demand())
    }

    fn change(&mut self, change: &Change) {
        if change.outcome != ChangeOutcome::Applied {
            self.refused = Some(change.clone());
        }
        self.recording.change(change);
    }
}

/// The same for the observers' thread and whoever else wants to know; never for the servo's.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Watch>>);

impl Shared {
    /// What was taken down so far. Not real-time: waits for the observers.
    pub fn lock(&self) -> MutexGuard<'_, Watch> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests all that a recording stores, from now on. Not real-time.
    pub fn expect_recordings(&self) {
        self.lock().ahead = Some(Demand::ALL);
    }
}

impl Observer for Shared {
    fn observe(&mut self, record: &TickRecord) {
        self.lock().observe(record);
    }

    fn demand(&self) -> Demand {
        self.lock().demand()
    }

    fn change(&mut self, change: &Change) {
        self.lock().change(change);
    }
}

/// What a tick says of handle and force along the vertical.
fn sample(record: &TickRecord) -> Sample {
    Sample {
        dt_s: record.dt_ns as f64 * 1.0e-9,
        z_m: record.pose.position().z,
        velocity_m_per_s: record.twist.linear().z,
        force_z_n: record.commanded.force().z,
        force_n: record.commanded.force().length(),
        out_of_range: record.events.intersects(Events::BOUNDARY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first ticks of a recording lacked torque and energy where its own request was the first.
    #[test]
    fn what_recordings_store_is_requested_before_the_first_of_them_begins() {
        let shared = Shared::default();
        assert_eq!(shared.demand(), Demand::FORCE);
        shared.expect_recordings();
        assert!(!shared.lock().recording.is_on());
        assert_eq!(shared.demand(), Demand::ALL);
    }
}
