//! Apparatus for a person: the servo loop in real time, in separate threads. Clients may display and stop the run; only the
//! experiment changes the stimuli.

use super::watch::{RunThread, Shared, spawn_run};
use super::{Apparatus, Kinematics};
use crate::apparatus::rig::{RunEnded, StimulusRefused, TrialFiles};
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::kinematics::KinematicsMeter;
use crate::log::Incident;
use crate::screen::StimulusExploration;
use crate::trial::Trial;
use flotor_live::{Ask, Directory, RefusalCause, Serve};
use flotor_record::Recorder;
use flotor_servo::{Clock, RunEnd, StopSwitch};
use flotor_session::telemetry::{ObservedRun, announce, emergency_stop, machine_stop};
use flotor_session::{ControlError, Controls, LatchGuard, RunError, RunOptions, RunRecording, Session};
use std::sync::Arc;
use std::time::Duration;

/// Settling time, longer than the loop takes to apply a change and the observers take to report the change.
const SETTLE: Duration = Duration::from_millis(20);

/// Real-time apparatus of one person. Dropping the apparatus stops the run.
pub struct RealTimeRig<'a> {
    apparatus: &'a Apparatus,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
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

impl<'a> RealTimeRig<'a> {
    /// Starts the run with the object faded out and publishes it to clients; a failed publication is not an error
    /// ([`Self::viewer_error`]).
    ///
    /// # Errors
    /// [`RunError`], an error of the thread's creation, or the loop's rejection of the first change.
    pub fn start(
        apparatus: &'a Apparatus,
        kinematics: Kinematics,
        stop: &StopSwitch,
    ) -> Result<Self, ApparatusOrFrontEndError> {
        let options = RunOptions { clock: Clock::Real, seed: 0 };
        let session = Session::prepare(&apparatus.stage.scene, &apparatus.stage.registry, &options)?;
        let session = session.with_strength(apparatus.stage.strength);
        let (controls, warnings) = (session.controls(), session.warnings().to_vec());
        apparatus.show(&controls, false)?;
        let (shared, stop) = (Shared::default(), stop.clone());
        let run = apparatus.stage.describe(&apparatus.stage.scene, Clock::Real, 0);
        let host = Arc::new(OnlyStop { stop: stop.clone(), latch: session.latch().cloned() });
        let publication = announce(&Directory::of_this_user(), &apparatus.stage.scene, &run, &session, host);
        let viewer_error = publication.as_ref().err().map(ToString::to_string);
        let observers = ObservedRun { observer: shared.clone(), publication: publication.ok() };
        let run = spawn_run(session, observers, stop.clone(), "the sitting has ended")?;
        Ok(Self {
            apparatus,
            kinematics,
            files: None,
            controls,
            stop,
            shared,
            viewer_error,
            warnings,
            run: Some(run),
            ended: None,
        })
    }

    /// Records every tick of all later trials, one file per trial; practice before a resumed sitting is not recorded.
    pub fn record_into(&mut self, files: TrialFiles) {
        self.shared.expect_recordings();
        self.files = Some(files);
    }

    /// Returns the warnings of the run about stops and devices, to be shown before the first trial.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the reason why no window can display the run; `None` if the run is published.
    #[must_use]
    pub fn viewer_error(&self) -> Option<&str> {
        self.viewer_error.as_deref()
    }

    /// Sets the stimulus, fades it in, waits until it can be felt, and starts the recording of the movement. Returns the reason if
    /// the recording cannot start; `None` if the recording has started or was not requested.
    ///
    /// # Errors
    /// If the run has ended, or the loop or the model rejected the change.
    pub fn begin(&mut self, trial: &Trial, value: f64) -> Result<Option<String>, ApparatusOrFrontEndError> {
        self.check()?;
        self.set(value)?;
        {
            // Measure the exploration from the first force of the fade-in on.
            let mut watch = self.shared.lock();
            watch.missed_ticks = 0;
            watch.meter = Some(KinematicsMeter::default());
        }
        self.apparatus.show(&self.controls, true)?;
        self.wait_for_fade();
        self.wait_until_seen();
        let mut watch = self.shared.lock();
        if let Some(change) = watch.refused.take() {
            return Err(StimulusRefused(change).into());
        }
        let is_of_sitting = trial.number > 0;
        if let (Some(files), false, true) = (&self.files, watch.recording.is_on(), is_of_sitting) {
            let run = self.apparatus.stage.describe(&self.apparatus.stage.scene, Clock::Real, 0);
            // Keep the recording of a trial that was interrupted earlier.
            match Recorder::create(&files.next_of(trial), &run) {
                Ok(recorder) => watch.recording = RunRecording::new(Some(recorder)),
                Err(error) => return Ok(Some(error.to_string())),
            }
        }
        Ok(None)
    }

    /// Returns the vertical path length of the handle since the stimulus began to fade in, m; `None` without a stimulus, or before
    /// its first sample.
    #[must_use]
    pub fn path_length_m(&self) -> Option<f64> {
        let watch = self.shared.lock();
        let moved = watch.meter.as_ref()?.finish()?;
        Some(moved.mean_speed_m_per_s * moved.duration_s)
    }

    /// Fades the object out and returns the measures of its exploration.
    ///
    /// # Errors
    /// If the run has ended, or the loop rejected the change.
    pub fn end(&mut self) -> Result<StimulusExploration, ApparatusOrFrontEndError> {
        let (meter, missed_ticks) = {
            let mut watch = self.shared.lock();
            (watch.meter.take().unwrap_or_default(), std::mem::take(&mut watch.missed_ticks))
        };
        self.check()?;
        self.apparatus.show(&self.controls, false)?;
        self.wait_for_fade();
        let kinematics = (self.kinematics != Kinematics::None).then(|| meter.finish()).flatten();
        Ok(StimulusExploration { kinematics, boundary_hit: meter.out_of_range, missed_ticks })
    }

    /// Closes the recording of an answered trial; does nothing without a recording.
    ///
    /// # Errors
    /// If the recording cannot be completed.
    pub fn close_recording(&mut self) -> Result<(), ApparatusOrFrontEndError> {
        Ok(self.shared.lock().recording.finish(&[])?)
    }

    /// Returns true while the handle is out of its range.
    #[must_use]
    pub fn is_out_of_range(&self) -> bool {
        self.shared.lock().out_of_range
    }

    /// Returns true if a stop was requested or the run has ended.
    fn is_stopping(&self) -> bool {
        self.stop.is_stop_requested() || self.run.as_ref().is_none_or(RunThread::is_finished)
    }

    /// Returns the incident that stops the sitting, if any: an emergency stop, a stop request, or the end of the run.
    pub fn stopped_by(&mut self) -> Option<Incident> {
        if let Some(source) = self.stop.emergency() {
            return Some(Incident::EmergencyStop { source: source.word().to_owned() });
        }
        if self.stop.is_stop_requested() {
            return Some(Incident::Signal);
        }
        self.check().err().map(|error| self.incident_of(error.as_ref()))
    }

    /// Converts an error that ended the sitting to an incident: an emergency stop, or the end of the run.
    #[must_use]
    pub fn incident_of(&self, error: &(dyn std::error::Error + Send + Sync + 'static)) -> Incident {
        let ended = error.downcast_ref::<RunEnded>().map(|ended| ended.0);
        match ended.or(self.ended) {
            Some(RunEnd::EmergencyStop(source)) => {
                Incident::EmergencyStop { source: source.word().to_owned() }
            }
            _ => Incident::RunEnded { reason: ended.map_or_else(|| error.to_string(), |end| end.cause()) },
        }
    }

    /// Ends the run of an interrupted sitting, and returns `ending`. After a complete sitting the run continues until the rig
    /// is dropped, so that the handle is still held during the final screen.
    ///
    /// # Errors
    /// If an error, a fault or an emergency stop ended the run.
    pub fn finish_after(&mut self, ending: Ending) -> Result<Ending, ApparatusOrFrontEndError> {
        if ending == Ending::Complete {
            return Ok(ending);
        }
        self.stop.stop();
        match self.join()? {
            Some(end) if !end.is_in_order() => Err(RunEnded(end).into()),
            None | Some(_) => Ok(ending),
        }
    }

    fn set(&self, value: f64) -> Result<(), ApparatusOrFrontEndError> {
        // A replaced model may still be fading out.
        for _ in 0..100 {
            match self.apparatus.set(&self.controls, value) {
                Err(ControlError::Busy) => std::thread::sleep(SETTLE),
                other => return Ok(other?),
            }
        }
        Err(ControlError::Busy.into())
    }

    fn wait_for_fade(&self) {
        std::thread::sleep(Duration::from_secs_f64(self.apparatus.fade_s) + SETTLE);
    }

    /// Waits until the loop has sampled the stimulus at least once, at most 5 s: on a busy machine the time of a fade may pass
    /// without a tick, and a trial needs a stimulus that could be felt.
    fn wait_until_seen(&self) {
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

    /// Returns an error if the run has ended.
    fn check(&mut self) -> Result<(), ApparatusOrFrontEndError> {
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

impl Drop for RealTimeRig<'_> {
    fn drop(&mut self) {
        self.stop.stop();
        let _ = self.join();
    }
}
