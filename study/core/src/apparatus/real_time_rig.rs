//! Apparatus for a person: the stimuli of a protocol on a run in real time.

use super::real_time_run::{RealTimeRun, SETTLE};
use super::{Apparatus, Kinematics};
use crate::apparatus::rig::TrialFiles;
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::screen::StimulusExploration;
use crate::trial::Trial;
use flotor_servo::StopSwitch;
use flotor_session::ControlError;

/// Real-time apparatus of one person. Dropping the apparatus stops the run.
pub struct RealTimeRig<'a> {
    apparatus: &'a Apparatus,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    run: RealTimeRun,
}

impl<'a> RealTimeRig<'a> {
    /// Starts the run with the object faded out and publishes it to clients; a failed publication is not an error
    /// ([`Self::viewer_error`]).
    ///
    /// # Errors
    /// [`flotor_session::RunError`], an error of the thread's creation, or the loop's rejection of the first change.
    pub fn start(
        apparatus: &'a Apparatus,
        kinematics: Kinematics,
        stop: &StopSwitch,
    ) -> Result<Self, ApparatusOrFrontEndError> {
        let stage = &apparatus.stage;
        let run =
            RealTimeRun::start(stage, &stage.scene, |controls| Ok(apparatus.show(controls, false)?), stop)?;
        Ok(Self { apparatus, kinematics, files: None, run })
    }

    /// Records every tick of all later trials, one file per trial; practice before a resumed sitting is not recorded.
    pub fn record_into(&mut self, files: TrialFiles) {
        self.run.expect_recordings();
        self.files = Some(files);
    }

    /// Returns the warnings of the run about stops and devices, to be shown before the first trial.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        self.run.warnings()
    }

    /// Returns the reason why no window can display the run; `None` if the run is published.
    #[must_use]
    pub fn viewer_error(&self) -> Option<&str> {
        self.run.viewer_error()
    }

    /// Sets the stimulus, fades it in, waits until it can be felt, and starts the recording of the movement. Returns the reason if
    /// the recording cannot start; `None` if the recording has started or was not requested.
    ///
    /// # Errors
    /// If the run has ended, or the loop or the model rejected the change.
    pub fn begin(&mut self, trial: &Trial, value: f64) -> Result<Option<String>, ApparatusOrFrontEndError> {
        self.run.check()?;
        self.set(value)?;
        // Measure the exploration from the first force of the fade-in on.
        self.run.begin_measurement();
        self.apparatus.show(self.run.controls(), true)?;
        RealTimeRun::wait_for_fade(self.apparatus.fade_s);
        self.run.wait_until_seen();
        self.run.check_changes()?;
        let is_of_sitting = trial.number > 0;
        let Some(files) = self.files.as_ref().filter(|_| is_of_sitting) else { return Ok(None) };
        let stage = &self.apparatus.stage;
        // Keep the recording of a trial that was interrupted earlier.
        Ok(self.run.record(stage, &stage.scene, || files.next_of(trial)))
    }

    /// Returns the run.
    pub(super) fn run(&mut self) -> &mut RealTimeRun {
        &mut self.run
    }

    /// Fades the object out and returns the measures of its exploration.
    ///
    /// # Errors
    /// If the run has ended, or the loop rejected the change.
    pub fn end(&mut self) -> Result<StimulusExploration, ApparatusOrFrontEndError> {
        let felt = self.run.end_measurement(self.kinematics);
        self.run.check()?;
        self.apparatus.show(self.run.controls(), false)?;
        RealTimeRun::wait_for_fade(self.apparatus.fade_s);
        Ok(felt)
    }

    /// Ends the run of an interrupted sitting, and returns `ending`. After a complete sitting the run continues until the rig
    /// is dropped, so that the handle is still held during the final screen.
    ///
    /// # Errors
    /// If an error, a fault or an emergency stop ended the run.
    pub fn finish_after(&mut self, ending: Ending) -> Result<Ending, ApparatusOrFrontEndError> {
        self.run.finish_after(ending)
    }

    fn set(&self, value: f64) -> Result<(), ApparatusOrFrontEndError> {
        // A replaced model may still be fading out.
        for _ in 0..100 {
            match self.apparatus.set(self.run.controls(), value) {
                Err(ControlError::Busy) => std::thread::sleep(SETTLE),
                other => return Ok(other?),
            }
        }
        Err(ControlError::Busy.into())
    }
}
