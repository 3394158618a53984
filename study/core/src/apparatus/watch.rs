//! Observer of a presentation: computes movement measures and, on request, records every tick.

use crate::kinematics::{KinematicsMeter, Sample};
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_hal::Demand;
use flotor_live::EndKind;
use flotor_servo::StopSwitch;
use flotor_session::telemetry::ObservedRun;
use flotor_session::{Observer, Outcome, RunError, RunRecording, Session};
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

/// Handle of the thread of a run.
pub type RunThread = JoinHandle<Result<Outcome, RunError>>;

/// Observer of every tick of a study.
#[derive(Default)]
pub struct Watch {
    /// Accumulator of movement measures; `None` unless a stimulus is felt.
    pub meter: Option<KinematicsMeter>,
    /// Recording of the trial in progress.
    pub recording: RunRecording,
    /// Outputs requested in advance for the recordings of later trials, because the loop applies a request some ticks later;
    /// `None` without recordings.
    pub ahead: Option<Demand>,
    /// Number of ticks missed since the last reset.
    pub missed_ticks: u64,
    /// True if the handle was out of its range in the last tick.
    pub out_of_range: bool,
    /// Newest stimulus change that the model rejected.
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

/// Runs a session in a new thread; at the end of the run notifies its clients with the text `end`.
///
/// # Errors
/// If the thread cannot be created.
pub fn spawn_run(
    session: Session,
    mut observers: ObservedRun<Shared>,
    stop: StopSwitch,
    end: &'static str,
) -> io::Result<RunThread> {
    std::thread::Builder::new().name("flotor-study".to_owned()).spawn(move || {
        let outcome = session.run(&mut observers, &stop);
        let is_in_order = outcome.as_ref().is_ok_and(|outcome| outcome.end.is_in_order());
        observers.end(end, if is_in_order { EndKind::InOrder } else { EndKind::Failed });
        outcome
    })
}

/// Shared handle to a [`Watch`], for the observers' thread and the experiment; must not be used in the servo thread.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Watch>>);

impl Shared {
    /// Locks the collected data. Not real-time: waits for the observers' thread.
    pub fn lock(&self) -> MutexGuard<'_, Watch> {
        flotor_core::lock(&self.0)
    }

    /// Requests all outputs that a recording stores, from now on. Not real-time.
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

/// Extracts vertical motion and commanded force from a tick.
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
