//! Run of a scene in real time, in threads of its own, for a person. Clients may display and stop the run; only the experiment
//! changes the stimuli.

use super::Kinematics;
use super::rig::{RunEnded, StimulusRefused};
use super::stage::Stage;
use super::watch::{RunThread, Shared, spawn_run};
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::kinematics::KinematicsMeter;
use crate::log::Incident;
use crate::screen::StimulusExploration;
use flotor_live::{Ask, Directory, RefusalCause, Serve};
use flotor_record::Recorder;
use flotor_servo::{Clock, RunEnd, StopSwitch};
use flotor_session::scene::Scene;
use flotor_session::telemetry::{ObservedRun, announce, emergency_stop, machine_stop};
use flotor_session::{Controls, LatchGuard, RunError, RunOptions, RunRecording, Session};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Settling time, longer than the loop takes to apply a change and the observers take to report the change.
pub(super) const SETTLE: Duration = Duration::from_millis(20);

/// Run in real time. Dropping it stops the run.
pub(super) struct RealTimeRun {
    controls: Controls,
    stop: StopSwitch,
    shared: Shared,
    viewer_error: Option<String>,
    /// Warnings about stops and devices.
    warnings: Vec<String>,
    run: Option<RunThread>,
    /// Reason for the end of the run, once known.
    ended: Option<RunEnd>,
}

/// Request handler through which clients may watch and stop a study, but not change stimuli.
struct OnlyStop {
    stop: StopSwitch,
    latch: Option<LatchGuard>,
}

impl Serve for OnlyStop {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        match ask {
            Ask::Watch { .. } | Ask::Unwatch => {} // handled by the publication
            Ask::Stop => self.stop.stop(),
            Ask::EmergencyStop => return emergency_stop(&self.stop, self.latch.as_ref()),
            Ask::MachineStop => machine_stop(&self.stop, self.latch.as_ref()),
            Ask::Set { .. } | Ask::Weight { .. } | Ask::Swap { .. } => {
                let words = "an experiment controls the stimulus; change the models after the experiment";
                return Err((RefusalCause::Other, words.to_owned()));
            }
        }
        Ok(())
    }
}

impl RealTimeRun {
    /// Prepares a scene, applies `first` before the first tick, starts the run and publishes it to clients; a failed publication is
    /// not an error ([`Self::viewer_error`]).
    ///
    /// # Errors
    /// [`RunError`], an error of the thread's creation, or errors of `first`.
    pub(super) fn start(
        stage: &Stage,
        scene: &Scene,
        first: impl FnOnce(&Controls) -> Result<(), ApparatusOrFrontEndError>,
        stop: &StopSwitch,
    ) -> Result<Self, ApparatusOrFrontEndError> {
        let options = RunOptions { clock: Clock::Real, seed: 0 };
        let session = Session::prepare(scene, &stage.registry, &options)?.with_strength(stage.strength);
        let (controls, warnings) = (session.controls(), session.warnings().to_vec());
        first(&controls)?;
        let (shared, stop) = (Shared::default(), stop.clone());
        let run = stage.describe(scene, Clock::Real, 0);
        let host = Arc::new(OnlyStop { stop: stop.clone(), latch: session.latch().cloned() });
        let publication = announce(&Directory::of_this_user(), scene, &run, &session, host);
        let viewer_error = publication.as_ref().err().map(ToString::to_string);
        let observers = ObservedRun { observer: shared.clone(), publication: publication.ok() };
        let run = spawn_run(session, observers, stop.clone(), "the sitting has ended")?;
        Ok(Self { controls, stop, shared, viewer_error, warnings, run: Some(run), ended: None })
    }

    /// Returns the handle that changes models and parameters.
    pub(super) fn controls(&self) -> &Controls {
        &self.controls
    }

    /// Returns the warnings of the run about stops and devices.
    pub(super) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the reason why no window can display the run; `None` if the run is published.
    pub(super) fn viewer_error(&self) -> Option<&str> {
        self.viewer_error.as_deref()
    }

    /// Requests all outputs that a recording stores, from now on.
    pub(super) fn expect_recordings(&self) {
        self.shared.expect_recordings();
    }

    /// Begins to measure the exploration.
    pub(super) fn begin_measurement(&self) {
        let mut watch = self.shared.lock();
        watch.missed_ticks = 0;
        watch.meter = Some(KinematicsMeter::default());
    }

    /// Ends the measurement of an exploration and returns its measures.
    pub(super) fn end_measurement(&self, kinematics: Kinematics) -> StimulusExploration {
        let (meter, missed_ticks) = {
            let mut watch = self.shared.lock();
            (watch.meter.take().unwrap_or_default(), std::mem::take(&mut watch.missed_ticks))
        };
        let measures = (kinematics != Kinematics::None).then(|| meter.finish()).flatten();
        StimulusExploration { kinematics: measures, boundary_hit: meter.out_of_range, missed_ticks }
    }

    /// Returns the vertical path length of the handle since the measurement began, m; `None` without one, or before its first sample.
    pub(super) fn path_length_m(&self) -> Option<f64> {
        let watch = self.shared.lock();
        let moved = watch.meter.as_ref()?.finish()?;
        Some(moved.mean_speed_m_per_s * moved.duration_s)
    }

    /// Returns an error if a model rejected a change since the last call.
    ///
    /// # Errors
    /// [`StimulusRefused`].
    pub(super) fn check_changes(&self) -> Result<(), StimulusRefused> {
        self.shared.lock().refused.take().map_or(Ok(()), |change| Err(StimulusRefused(change.into())))
    }

    /// Starts a recording of the movement unless one is in progress. Returns the reason if it cannot start.
    pub(super) fn record(
        &self,
        stage: &Stage,
        scene: &Scene,
        path: impl FnOnce() -> PathBuf,
    ) -> Option<String> {
        let mut watch = self.shared.lock();
        if watch.recording.is_on() {
            return None;
        }
        match Recorder::create(&path(), &stage.describe(scene, Clock::Real, 0)) {
            Ok(recorder) => watch.recording = RunRecording::new(Some(recorder)),
            Err(error) => return Some(error.to_string()),
        }
        None
    }

    /// Closes the recording; does nothing without one.
    ///
    /// # Errors
    /// If the recording cannot be completed.
    pub(super) fn close_recording(&self) -> Result<(), ApparatusOrFrontEndError> {
        Ok(self.shared.lock().recording.finish(&[])?)
    }

    /// Returns true while the handle is out of its range.
    pub(super) fn is_out_of_range(&self) -> bool {
        self.shared.lock().out_of_range
    }

    /// Waits until a fade of this duration is complete.
    pub(super) fn wait_for_fade(fade_s: f64) {
        std::thread::sleep(Duration::from_secs_f64(fade_s) + SETTLE);
    }

    /// Waits until the loop has sampled the stimulus at least once, at most 5 s: on a busy machine the time of a fade may pass
    /// without a tick, and a trial needs a stimulus that could be felt.
    pub(super) fn wait_until_seen(&self) {
        const MOST_LOOKS: u32 = 250;
        let is_seen = || {
            let watch = self.shared.lock();
            watch.meter.as_ref().is_none_or(|meter| meter.finish().is_some())
        };
        for _ in 0..MOST_LOOKS {
            if is_seen() || self.is_stopping() {
                return;
            }
            std::thread::sleep(SETTLE);
        }
    }

    /// Returns true if a stop was requested or the run has ended.
    fn is_stopping(&self) -> bool {
        self.stop.is_stop_requested() || self.run.as_ref().is_none_or(RunThread::is_finished)
    }

    /// Returns the incident that stops the sitting, if any: an emergency stop, a stop request, or the end of the run.
    pub(super) fn stopped_by(&mut self) -> Option<Incident> {
        if let Some(source) = self.stop.emergency() {
            return Some(Incident::EmergencyStop { source: source.word().to_owned() });
        }
        if self.stop.is_stop_requested() {
            return Some(Incident::Signal);
        }
        self.check().err().map(|error| self.incident_of(error.as_ref()))
    }

    /// Converts an error that ended the sitting to an incident: an emergency stop, or the end of the run.
    pub(super) fn incident_of(&self, error: &(dyn std::error::Error + Send + Sync + 'static)) -> Incident {
        let ended = error.downcast_ref::<RunEnded>().map(|ended| ended.0);
        match ended.or(self.ended) {
            Some(RunEnd::EmergencyStop(source)) => {
                Incident::EmergencyStop { source: source.word().to_owned() }
            }
            _ => Incident::RunEnded { reason: ended.map_or_else(|| error.to_string(), |end| end.cause()) },
        }
    }

    /// Ends the run of an interrupted sitting, and returns `ending`. After a complete sitting the run continues until it is dropped,
    /// so that the handle is still held during the final screen.
    ///
    /// # Errors
    /// If an error, a fault or an emergency stop ended the run.
    pub(super) fn finish_after(&mut self, ending: Ending) -> Result<Ending, ApparatusOrFrontEndError> {
        if ending == Ending::Complete {
            return Ok(ending);
        }
        self.stop.stop();
        match self.join()? {
            Some(end) if !end.is_in_order() => Err(RunEnded(end).into()),
            None | Some(_) => Ok(ending),
        }
    }

    /// Returns an error if the run has ended.
    ///
    /// # Errors
    /// [`RunEnded`], or the error of the run.
    pub(super) fn check(&mut self) -> Result<(), ApparatusOrFrontEndError> {
        if self.run.as_ref().is_some_and(|run| !run.is_finished()) {
            return Ok(());
        }
        let end = self.join()?.ok_or(RunError::Thread("panicked"))?;
        Err(RunEnded(end).into())
    }

    /// Waits for the end of the run, and returns its kind; `None` after a panic of the run that was already reported.
    fn join(&mut self) -> Result<Option<RunEnd>, RunError> {
        if let Some(run) = self.run.take() {
            let outcome = run.join().map_err(|_| RunError::Thread("panicked"))?;
            self.ended = Some(outcome?.end);
        }
        Ok(self.ended)
    }
}

impl Drop for RealTimeRun {
    fn drop(&mut self) {
        self.stop.stop();
        let _ = self.join();
    }
}
