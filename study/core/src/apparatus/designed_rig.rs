//! Apparatus of a designed study for a simulated subject, in virtual time with a simulated hand.

use super::Kinematics;
use super::designed_change::{Changeable, Fade, IntervalSettings, Settings, change, fade};
use super::designed_setup::DesignedApparatus;
use super::rig::{RunEnded, StimulusRefused, TrialFiles};
use super::watch::Watch;
use crate::conduct::ApparatusOrFrontEndError;
use crate::designed::DesignedPresenter;
use crate::kinematics::KinematicsMeter;
use crate::trial::Exploration;
use flotor_record::Recorder;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::scene::Scene;
use flotor_session::{Controls, RunError, RunRecording, Steps};
use flotor_study_design::course::{Session as Sitting, Trial};
use flotor_study_design::value::{Setting, Value};

/// Apparatus of one session of a simulated subject.
pub struct DesignedRig<'a> {
    apparatus: &'a DesignedApparatus,
    sitting: Sitting,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    feel_s: f64,
    stop: StopSwitch,
    run: Option<Run>,
}

/// Run with constant settings of the devices.
struct Run {
    steps: Steps,
    watch: Watch,
    scene: Scene,
    seed: u64,
    /// Settings that need a new run.
    fixed: Settings,
    /// Settings of replaced models.
    replaced: Settings,
}

impl Changeable for Run {
    fn controls(&self) -> &Controls {
        self.steps.controls()
    }

    fn pass(&mut self, seconds: f64) -> Result<(), ApparatusOrFrontEndError> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // minutes at most
        let ticks = (seconds * self.scene.rate_hz).ceil() as u64;
        let end = self.steps.advance(ticks, &mut self.watch)?;
        if let Some(end) = end {
            return Err(RunEnded(end).into());
        }
        self.watch.refused.take().map_or(Ok(()), |change| Err(StimulusRefused(change.into()).into()))
    }
}

impl Run {
    /// Presents one interval: fades out what changes, changes it, fades it in, and waits while it is felt.
    fn feel(
        &mut self,
        apparatus: &DesignedApparatus,
        settings: &IntervalSettings,
        feel_s: f64,
    ) -> Result<(), ApparatusOrFrontEndError> {
        let (models, scene) = (settings.models(), &apparatus.stage.scene);
        fade(self, scene, &models, Fade::Out)?;
        let mut replaced = std::mem::take(&mut self.replaced);
        change(self, apparatus, settings, &mut replaced)?;
        self.replaced = replaced;
        fade(self, scene, &models, Fade::In)?;
        self.watch.meter = Some(KinematicsMeter::default());
        self.pass(feel_s)
    }
}

impl<'a> DesignedRig<'a> {
    /// Creates the apparatus of a session; the first trial starts the run. Each interval is felt for `feel_s` seconds, fades excluded;
    /// `stop` ends the run.
    #[must_use]
    pub fn new(
        apparatus: &'a DesignedApparatus,
        sitting: Sitting,
        kinematics: Kinematics,
        files: Option<TrialFiles>,
        feel_s: f64,
        stop: &StopSwitch,
    ) -> Self {
        Self { apparatus, sitting, kinematics, files, feel_s, stop: stop.clone(), run: None }
    }

    /// Returns the run with the settings of devices: the present one, or a new one if they differ.
    fn run(&mut self, settings: &IntervalSettings) -> Result<&mut Run, ApparatusOrFrontEndError> {
        let watch = match self.run.take() {
            Some(run) if run.fixed == settings.fixed => return Ok(self.run.insert(run)),
            // The earlier run ends before the next one begins: a device has one run at a time. A recording continues.
            Some(run) => run.watch,
            None => Watch::default(),
        };
        let run = self.begin(settings, watch)?;
        Ok(self.run.insert(run))
    }

    fn begin(&self, settings: &IntervalSettings, watch: Watch) -> Result<Run, ApparatusOrFrontEndError> {
        let Sitting { seed, subject, session } = self.sitting;
        let mut scene = self.apparatus.stage.scene_with_hand(seed, subject);
        settings.apply_fixed(&mut scene)?;
        // A different seed for each subject and session, so that the tremor differs, too.
        let name = u64::from(subject.get()) + (u64::from(session) << 10);
        let seed = seed.wrapping_mul(1 << 20).wrapping_add(name);
        let steps = Steps::prepare(&scene, &self.apparatus.stage.registry, seed, &self.stop)?;
        let fixed = settings.fixed.clone();
        Ok(Run { steps, watch, scene, seed, fixed, replaced: Settings::new() })
    }

    fn explore(
        &mut self,
        trial: &Trial,
        intervals: &[Vec<(Setting, Value)>],
    ) -> Result<Exploration, ApparatusOrFrontEndError> {
        let (apparatus, kinematics, feel_s) = (self.apparatus, self.kinematics, self.feel_s);
        let mut exploration = Exploration::default();
        for (index, settings) in intervals.iter().enumerate() {
            let settings = IntervalSettings::of(apparatus, settings);
            let file = self.files.as_ref().filter(|_| index == 0 && kinematics == Kinematics::Full);
            let file = file.map(|files| files.next_of_number(trial.number));
            let run = self.run(&settings)?;
            if let Some(path) = file {
                let described = apparatus.stage.describe(&run.scene, Clock::Virtual, run.seed);
                run.watch.recording = RunRecording::new(Some(Recorder::create(&path, &described)?));
            }
            run.feel(apparatus, &settings, feel_s)?;
            if let Some(meter) = run.watch.meter.take() {
                exploration.boundary_hit |= meter.out_of_range;
                if kinematics != Kinematics::None {
                    exploration.kinematics.extend(meter.finish());
                }
            }
            exploration.missed_ticks += std::mem::take(&mut run.watch.missed_ticks);
        }
        if let Some(run) = &mut self.run {
            run.watch.recording.finish(&[])?;
        }
        Ok(exploration)
    }
}

impl DesignedPresenter for DesignedRig<'_> {
    fn present(
        &mut self,
        trial: &Trial,
        intervals: &[Vec<(Setting, Value)>],
    ) -> Result<Option<Exploration>, ApparatusOrFrontEndError> {
        use flotor_servo::RunEnd;
        match self.explore(trial, intervals) {
            Err(error) if matches!(error.downcast_ref(), Some(RunEnded(RunEnd::Stopped))) => Ok(None),
            Err(error) if error.downcast_ref().is_some_and(RunError::is_stopped) => Ok(None),
            presented => presented.map(Some),
        }
    }
}
