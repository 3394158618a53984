//! Presents stimuli to a person: the servo loop in real time, on threads of its own. Clients may show it and stop it; only the
//! experiment changes the stimuli.

use super::watch::Shared;
use super::{Apparatus, Kinematics};
use crate::apparatus::rig::{RunEnded, StimulusRefused, TrialFiles};
use crate::conduct::OutsideError;
use crate::kinematics::KinematicsMeter;
use crate::screen::Felt;
use crate::trial::Trial;
use flotor_live::{Ask, Directory, RefusalCause, Serve};
use flotor_record::Recorder;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::telemetry::{Watched, announce, emergency_stop};
use flotor_session::{
    ControlError, Controls, LatchGuard, Outcome, RunError, RunOptions, RunRecording, Session,
};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Longer than the time in which the loop applies a change and its observers report it.
const SETTLE: Duration = Duration::from_millis(20);

/// The apparatus of one person, in real time. Dropped, it ends the run in order.
pub struct RealTimeRig<'a> {
    apparatus: &'a Apparatus,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    controls: Controls,
    stop: StopSwitch,
    shared: Shared,
    unseen: Option<String>,
    run: Option<JoinHandle<Result<Outcome, RunError>>>,
}

/// A client of a study may end it, and nothing else.
struct OnlyStop {
    stop: StopSwitch,
    latch: Option<LatchGuard>,
}

impl Serve for OnlyStop {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        match ask {
            Ask::Watch { .. } | Ask::LookAway => {} // the publication's own
            Ask::Stop => self.stop.stop(),
            Ask::EmergencyStop => return emergency_stop(&self.stop, self.latch.as_ref()),
            Ask::Set { .. } | Ask::Weight { .. } | Ask::Swap { .. } => {
                let words = "an experiment is under way: what is felt is its own to change";
                return Err((RefusalCause::Other, words.to_owned()));
            }
        }
        Ok(())
    }
}

impl<'a> RealTimeRig<'a> {
    /// Starts the loop; no object is felt yet.
    ///
    /// # Errors
    /// [`RunError`], or what the loop said to the first change.
    pub fn start(
        apparatus: &'a Apparatus,
        kinematics: Kinematics,
        stop: &StopSwitch,
    ) -> Result<Self, OutsideError> {
        let options = RunOptions { clock: Clock::Real, seed: 0 };
        let session = Session::prepare(apparatus.scene(), apparatus.registry(), &options)?;
        let session = session.with_strength(apparatus.strength());
        let controls = session.controls();
        apparatus.show(&controls, false)?;
        let (shared, stop) = (Shared::default(), stop.clone());
        let run = apparatus.describe(apparatus.scene(), Clock::Real, 0);
        let host = Arc::new(OnlyStop { stop: stop.clone(), latch: session.latch().cloned() });
        let publication = announce(&Directory::of_this_user(), apparatus.scene(), &run, &session, host);
        let unseen = publication.as_ref().err().map(ToString::to_string);
        let mut observers = Watched { observer: shared.clone(), publication: publication.ok() };
        let switch = stop.clone();
        let thread = std::thread::Builder::new().name("flotor-study".to_owned());
        let run = thread.spawn(move || {
            let outcome = session.run(&mut observers, &switch);
            observers.end("the sitting has ended");
            outcome
        })?;
        Ok(Self { apparatus, kinematics, files: None, controls, stop, shared, unseen, run: Some(run) })
    }

    /// From now on keeps every tick of every trial, in a file for each.
    pub fn record_into(&mut self, files: TrialFiles) {
        self.files = Some(files);
    }

    /// Why no window can watch the run, if so.
    #[must_use]
    pub fn unseen(&self) -> Option<&str> {
        self.unseen.as_deref()
    }

    /// Gives the object its value and lets it be felt.
    ///
    /// # Errors
    /// The run has ended, or the model refused.
    pub fn begin(&mut self, trial: &Trial, value: f64) -> Result<(), OutsideError> {
        self.check()?;
        self.set(value)?;
        {
            // Exploration begins when there is something to feel, not when all of it is there.
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
        if let (Some(files), false) = (&self.files, watch.recording.is_on()) {
            let run = self.apparatus.describe(self.apparatus.scene(), Clock::Real, 0);
            watch.recording = RunRecording::new(Some(Recorder::create(&files.of(trial), &run)?));
        }
        Ok(())
    }

    /// Lets the object go; how it was felt.
    ///
    /// # Errors
    /// The run has ended.
    pub fn end(&mut self) -> Result<Felt, OutsideError> {
        let (meter, missed_ticks) = {
            let mut watch = self.shared.lock();
            (watch.meter.take().unwrap_or_default(), std::mem::take(&mut watch.missed_ticks))
        };
        self.check()?;
        self.apparatus.show(&self.controls, false)?;
        self.wait_for_fade();
        let kinematics = (self.kinematics != Kinematics::None).then(|| meter.finish()).flatten();
        Ok(Felt { kinematics, boundary_hit: meter.out_of_range(), missed_ticks })
    }

    /// Closes the recording of a trial that was answered.
    ///
    /// # Errors
    /// The recording.
    pub fn close_recording(&mut self) -> Result<(), OutsideError> {
        Ok(self.shared.lock().recording.finish(&[])?)
    }

    /// Whether the handle is out of its range right now.
    #[must_use]
    pub fn is_out_of_range(&self) -> bool {
        self.shared.lock().out_of_range
    }

    /// Whether somebody asked the run to stop, or it ended by itself.
    #[must_use]
    pub fn is_stopping(&self) -> bool {
        self.stop.is_stop_asked() || self.run.as_ref().is_none_or(JoinHandle::is_finished)
    }

    fn set(&self, value: f64) -> Result<(), OutsideError> {
        // A model that was replaced may still be fading.
        for _ in 0..100 {
            match self.apparatus.set(&self.controls, value) {
                Err(ControlError::Busy) => std::thread::sleep(SETTLE),
                other => return Ok(other?),
            }
        }
        Err(ControlError::Busy.into())
    }

    fn wait_for_fade(&self) {
        std::thread::sleep(Duration::from_secs_f64(self.apparatus.fade_s()) + SETTLE);
    }

    /// Waits until the loop has seen the object: on a machine with other things to do a fade's time may pass without a tick,
    /// and what nobody could feel is no trial.
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

    /// An error if the run has ended by itself.
    fn check(&mut self) -> Result<(), OutsideError> {
        if !self.run.as_ref().is_some_and(JoinHandle::is_finished) {
            return Ok(());
        }
        let ended = self.run.take().map(JoinHandle::join);
        match ended {
            Some(Ok(outcome)) => Err(RunEnded(outcome?.end).into()),
            Some(Err(_)) | None => Err(RunError::Thread("panicked").into()),
        }
    }
}

impl Drop for RealTimeRig<'_> {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(run) = self.run.take() {
            let _ = run.join();
        }
    }
}
