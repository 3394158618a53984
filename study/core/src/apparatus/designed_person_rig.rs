//! Apparatus of a designed study for a person, in real time.

use super::Kinematics;
use super::designed_change::{Changeable, Fade, IntervalSettings, Settings, change, start_fade};
use super::designed_setup::DesignedApparatus;
use super::real_time_run::RealTimeRun;
use super::rig::TrialFiles;
use crate::conduct::{ApparatusOrFrontEndError, Ending};
use crate::screen::StimulusExploration;
use flotor_servo::StopSwitch;
use flotor_session::Controls;
use flotor_study_design::value::{Setting, Value};
use std::io;
use std::time::Duration;

/// Real-time apparatus of one person. Dropping the apparatus stops the run.
pub struct DesignedPersonRig<'a> {
    apparatus: &'a DesignedApparatus,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    stop: StopSwitch,
    run: RealTimeRun,
    /// Models that are faded out between intervals: those that change, all if none does.
    models: Vec<String>,
    /// Settings of the run.
    fixed: Settings,
    /// Settings of replaced models.
    replaced: Settings,
}

impl Changeable for RealTimeRun {
    fn controls(&self) -> &Controls {
        self.controls()
    }

    fn pass(&mut self, seconds: f64) -> Result<(), ApparatusOrFrontEndError> {
        Self::wait_for_fade(seconds);
        self.check()
    }
}

impl<'a> DesignedPersonRig<'a> {
    /// Starts the run with the settings of the first interval and the models faded out, and publishes it to clients. `stop` ends the
    /// sitting.
    ///
    /// # Errors
    /// [`flotor_session::RunError`], an error of a thread's creation, or the loop's rejection of the first change.
    pub fn start(
        apparatus: &'a DesignedApparatus,
        first: &[(Setting, Value)],
        kinematics: Kinematics,
        stop: &StopSwitch,
    ) -> Result<Self, ApparatusOrFrontEndError> {
        let settings = IntervalSettings::of(apparatus, first);
        let mut models = settings.models();
        if models.is_empty() {
            models.extend(apparatus.stage.scene.models.iter().map(|model| model.name.clone()));
        }
        let run = begin(apparatus, &settings, &models, stop)?;
        Ok(Self {
            apparatus,
            kinematics,
            files: None,
            stop: stop.clone(),
            run,
            models,
            fixed: settings.fixed,
            replaced: Settings::new(),
        })
    }

    /// Records every tick of all later trials, one file per trial.
    pub fn record_into(&mut self, files: TrialFiles) {
        self.run.expect_recordings();
        self.files = Some(files);
    }

    /// Returns the warnings of the run about stops and devices, to be shown before the first trial.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        self.run.warnings()
    }

    /// Returns the run.
    pub(super) fn run(&mut self) -> &mut RealTimeRun {
        &mut self.run
    }

    /// Changes the settings, fades the models in, waits until they can be felt, and starts the recording of the movement. Returns the
    /// reason if the recording cannot start. Settings of devices that differ from those of the run need a new run, whose start takes
    /// the time of opening the devices.
    ///
    /// # Errors
    /// If the run has ended, or the loop, a model or a device rejected the change.
    pub(super) fn begin(
        &mut self,
        trial: u32,
        settings: &[(Setting, Value)],
    ) -> Result<Option<String>, ApparatusOrFrontEndError> {
        self.run.check()?;
        let settings = IntervalSettings::of(self.apparatus, settings);
        if settings.fixed != self.fixed {
            // The earlier run ends first: a device has one run at a time.
            self.run.close_recording()?;
            self.run.finish_after(Ending::Stopped)?;
            self.run = begin(self.apparatus, &settings, &self.models, &self.stop)?;
            if self.files.is_some() {
                self.run.expect_recordings();
            }
            self.fixed.clone_from(&settings.fixed);
            self.replaced.clear();
        }
        let stage = &self.apparatus.stage;
        change(&mut self.run, self.apparatus, &settings, &mut self.replaced)?;
        // Measure the exploration from the first force of the fade-in on.
        self.run.begin_measurement();
        let fade_s = start_fade(self.run.controls(), &stage.scene, &self.models, Fade::In)?;
        RealTimeRun::wait_for_fade(fade_s);
        self.run.wait_until_seen();
        self.run.check_changes()?;
        let Some(files) = &self.files else { return Ok(None) };
        Ok(self.run.record(stage, &stage.scene, || files.next_of_number(trial)))
    }

    /// Fades the models out and returns the measures of the exploration.
    ///
    /// # Errors
    /// If the run has ended, or the loop rejected the change.
    pub(super) fn end(&mut self) -> Result<StimulusExploration, ApparatusOrFrontEndError> {
        let felt = self.run.end_measurement(self.kinematics);
        self.run.check()?;
        let scene = &self.apparatus.stage.scene;
        let fade_s = start_fade(self.run.controls(), scene, &self.models, Fade::Out)?;
        RealTimeRun::wait_for_fade(fade_s);
        Ok(felt)
    }

    /// Ends the run of an interrupted sitting, and returns `ending`. After a complete sitting the run continues until the rig is
    /// dropped, so that the handle is still held during the final screen.
    ///
    /// # Errors
    /// If an error, a fault or an emergency stop ended the run.
    pub fn finish_after(&mut self, ending: Ending) -> Result<Ending, ApparatusOrFrontEndError> {
        self.run.finish_after(ending)
    }
}

fn begin(
    apparatus: &DesignedApparatus,
    settings: &IntervalSettings,
    models: &[String],
    stop: &StopSwitch,
) -> Result<RealTimeRun, ApparatusOrFrontEndError> {
    let mut scene = apparatus.stage.scene.clone();
    settings.apply_fixed(&mut scene)?;
    let fade_out =
        |controls: &Controls| start_fade(controls, &scene, models, Fade::Out).map(drop).map_err(Into::into);
    RealTimeRun::start(&apparatus.stage, &scene, fade_out, &linked(stop)?)
}

/// Returns a switch for one of several runs of a sitting: it follows the switch of the sitting within a millisecond, and a request to
/// end one run does not end the sitting.
fn linked(sitting: &StopSwitch) -> io::Result<StopSwitch> {
    let (sitting, run) = (sitting.clone(), StopSwitch::default());
    let of_run = run.clone();
    let thread = std::thread::Builder::new().name("flotor-stop".to_owned()).spawn(move || {
        while !of_run.is_stop_requested() && of_run.emergency().is_none() {
            sitting.sleep_until_pressed(Duration::from_millis(1));
            if let Some(source) = sitting.emergency() {
                of_run.press(source);
            }
            if sitting.is_stop_requested() {
                of_run.stop();
            }
        }
    });
    thread.map(|_| run)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_servo::EmergencySource;

    /// Waits until a condition holds; the test's own timeout ends the wait otherwise.
    fn until(condition: impl Fn() -> bool) {
        while !condition() {
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_run_follows_the_sitting_and_not_the_reverse() {
        let sitting = StopSwitch::default();
        let first = linked(&sitting).unwrap();
        first.stop();
        assert!(!sitting.is_stop_requested());
        let second = linked(&sitting).unwrap();
        assert!(!second.is_stop_requested());
        sitting.stop();
        until(|| second.is_stop_requested());
        let sitting = StopSwitch::default();
        let third = linked(&sitting).unwrap();
        sitting.press(EmergencySource::Signal);
        until(|| third.emergency() == Some(EmergencySource::Signal));
    }
}
