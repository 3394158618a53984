//! Presents stimuli to a person: the servo loop in real time, on threads of its own.

use super::watch::Watch;
pub use super::watch::sample as measured;
use super::{Apparatus, Kinematics};
use crate::record::{Change, Recorder};
use crate::servo::{Clock, StopSwitch};
use crate::session::{ControlError, Controls, Observer, Outcome, RunError, RunOptions, Session};
use crate::study::rig::{RunEnded, StimulusRefused, TrialFiles};
use crate::trace::TickRecord;
use flotor_study::conduct::OutsideError;
use flotor_study::kinematics::KinematicsMeter;
use flotor_study::trial::Trial;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Longer than the loop takes to take in a change and its observers to say so.
const SETTLE: Duration = Duration::from_millis(20);

/// The apparatus of one person, in real time. Dropped, it ends the run in order.
pub struct LiveRig<'a> {
    apparatus: &'a Apparatus,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    controls: Controls,
    stop: StopSwitch,
    shared: Shared,
    run: Option<JoinHandle<Result<Outcome, RunError>>>,
}

/// What the observers' thread and the experiment share; never the servo's.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Watch>>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Watch> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Shared {
    fn observe(&mut self, record: &TickRecord) {
        self.lock().observe(record);
    }

    fn change(&mut self, change: &Change) {
        self.lock().change(change);
    }
}

impl<'a> LiveRig<'a> {
    /// Starts the loop; no object is felt yet.
    ///
    /// # Errors
    /// [`RunError`], or what the loop said to the first change.
    pub fn start(
        apparatus: &'a Apparatus,
        kinematics: Kinematics,
        files: Option<TrialFiles>,
        stop: &StopSwitch,
    ) -> Result<Self, OutsideError> {
        let options = RunOptions { clock: Clock::Real, seed: 0 };
        let session = Session::prepare(apparatus.scene(), apparatus.registry(), &options)?;
        let controls = session.controls();
        apparatus.show(&controls, false)?;
        let (shared, stop) = (Shared::default(), stop.clone());
        let (mut observer, switch) = (shared.clone(), stop.clone());
        let thread = std::thread::Builder::new().name("flotor-study".to_owned());
        let run = thread.spawn(move || session.run(&mut observer, &switch))?;
        Ok(Self { apparatus, kinematics, files, controls, stop, shared, run: Some(run) })
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
        let mut watch = self.shared.lock();
        if let Some(what) = watch.refused.take() {
            return Err(StimulusRefused(what).into());
        }
        if let (Kinematics::Full, Some(files)) = (self.kinematics, &self.files)
            && watch.recorder.is_none()
        {
            let run = self.apparatus.describe(self.apparatus.scene(), Clock::Real, 0);
            watch.recorder = Some(Recorder::create(&files.of(trial), &run)?);
        }
        Ok(())
    }

    /// Lets the object go; how it was explored, and the ticks the servo missed meanwhile.
    ///
    /// # Errors
    /// The run has ended.
    pub fn end(&mut self) -> Result<(KinematicsMeter, u64), OutsideError> {
        let (meter, missed) = {
            let mut watch = self.shared.lock();
            (watch.meter.take().unwrap_or_default(), std::mem::take(&mut watch.missed_ticks))
        };
        self.check()?;
        self.apparatus.show(&self.controls, false)?;
        self.wait_for_fade();
        Ok((meter, missed))
    }

    /// Closes the recording of a trial that was answered.
    ///
    /// # Errors
    /// The recording.
    pub fn close_recording(&mut self) -> Result<(), OutsideError> {
        Ok(self.shared.lock().finish_recording()?)
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

impl Drop for LiveRig<'_> {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(run) = self.run.take() {
            let _ = run.join();
        }
    }
}
