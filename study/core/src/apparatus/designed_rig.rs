//! Apparatus of a designed study: a scene, all of whose settings may be factors, in virtual time with a simulated hand.
//!
//! A live number of a model changes while the model is faded out; any other setting of a model replaces the model then. A setting of a
//! device is fixed for a run: a new run begins when it changes.

use super::rig::{RunEnded, StimulusRefused, TrialFiles};
use super::stage::{DURATION_S, Stage, UnreadableFile};
use super::watch::Watch;
use super::{ApparatusError, Kinematics};
use crate::conduct::ApparatusOrFrontEndError;
use crate::designed::DesignedPresenter;
use crate::kinematics::KinematicsMeter;
use crate::log::InputFile;
use crate::trial::Exploration;
use flotor_hal::{Mutability, ParameterKind};
use flotor_record::Recorder;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::{PluginKeyValue, Scene};
use flotor_session::{ControlError, NewValue, RunError, RunOptions, RunRecording, Session, Steps, Strength};
use flotor_study_design::course::{Session as Sitting, Trial};
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::value::{Setting, Value};
use std::collections::BTreeMap;

/// Error of a design on a scene: a setting that the scene, a plugin or the device refuses.
#[derive(Debug, thiserror::Error)]
#[error("{setting} = {value}: {problem}")]
pub struct RefusedSetting {
    /// Setting of the design.
    pub setting: String,
    /// Value of the design.
    pub value: String,
    /// Problem and remedy.
    pub problem: String,
}

/// Error of checking a design on a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DesignedApparatusError {
    /// Error of the scene or the device without any setting of the design.
    #[error(transparent)]
    Scene(#[from] ApparatusError),
    /// A setting of the design is refused.
    #[error(transparent)]
    Setting(#[from] RefusedSetting),
}

/// Way of changing a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// Live number of a model.
    Live,
    /// Other setting of a model: the model is replaced.
    Replacement,
    /// Setting of a device: a new run begins.
    NewRun,
    /// The picture: nothing to feel.
    Unfelt,
}

/// Values of settings, by part and key.
type Settings = BTreeMap<(String, String), String>;

/// Scene of a designed study, checked.
pub struct DesignedApparatus {
    stage: Stage,
    notices: Vec<String>,
}

impl DesignedApparatus {
    /// Checks a design against a scene: every level of every factor, and the smallest and largest stimulus, are settings that scene,
    /// plugins and device accept. Not real-time; energises nothing.
    ///
    /// # Errors
    /// The first [`DesignedApparatusError`] found.
    pub fn check(
        mut scene: Scene,
        design: &Design,
        strength: Strength,
    ) -> Result<Self, DesignedApparatusError> {
        scene.duration_s = DURATION_S;
        let registry = Registry::search(&scene.plugin_folders);
        let options = RunOptions { clock: Clock::Virtual, seed: 0 };
        let session = Session::prepare(&scene, &registry, &options).map_err(ApparatusError::from)?;
        let session = session.with_strength(strength);
        if let Some(device) = session.held_back().first() {
            return Err(ApparatusError::ExceedsForceCeiling { device: device.clone() }.into());
        }
        let (plugins, notices) = (session.plugins().to_vec(), session.notices());
        drop(session);
        let apparatus = Self { stage: Stage { scene, registry, plugins, strength }, notices };
        for (setting, value) in settings_of(design) {
            let refused = |problem: String| RefusedSetting {
                setting: setting.to_string(),
                value: value.to_string(),
                problem,
            };
            let scene = apparatus.with(&[(setting.clone(), value.clone())]).map_err(refused)?;
            let prepared = Session::prepare(&scene, &apparatus.stage.registry, &options);
            drop(prepared.map_err(|error| refused(error.to_string()))?);
        }
        Ok(apparatus)
    }

    /// Checks that the first device has all parameters of a simulated hand.
    ///
    /// # Errors
    /// [`ApparatusError::NoHand`].
    pub fn check_hand(&self) -> Result<(), ApparatusError> {
        let missing = self.stage.missing_hand_parameter();
        missing.map_or(Ok(()), |missing| Err(ApparatusError::NoHand { device: self.stage.device(), missing }))
    }

    /// Returns the notices about force limits, one line each.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Returns the configuration that determines the stimuli, for the log.
    #[must_use]
    pub fn description(&self) -> serde_json::Value {
        self.stage.description()
    }

    /// Returns the files named by settings of the scene, with their hashes. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn input_files(&self) -> Result<Vec<InputFile>, UnreadableFile> {
        self.stage.input_files()
    }

    /// Returns the scene with settings.
    fn with(&self, settings: &[(Setting, Value)]) -> Result<Scene, String> {
        let mut scene = self.stage.scene.clone();
        for (setting, value) in settings {
            if let Setting::Scene { part, key } = setting {
                format!("{part}.{key}={value}").parse::<PluginKeyValue>()?.apply(&mut scene)?;
            }
        }
        Ok(scene)
    }

    /// Returns the way in which a setting changes.
    fn change(&self, setting: &Setting) -> Change {
        let Setting::Scene { part, key } = setting else { return Change::Unfelt };
        if !self.stage.scene.models.iter().any(|model| model.name == *part) {
            return Change::NewRun;
        }
        let plugin =
            self.stage.plugins.iter().skip(self.stage.scene.devices.len()).find(|one| one.name == *part);
        let parameter =
            plugin.and_then(|plugin| plugin.schema.iter().find(|parameter| parameter.id() == *key));
        let is_live = parameter.is_some_and(|parameter| {
            parameter.kind() == ParameterKind::Real && parameter.mutability() == Mutability::Live
        });
        if is_live { Change::Live } else { Change::Replacement }
    }
}

/// Returns every level of every factor, and the stimulus at its extreme levels in every condition.
fn settings_of(design: &Design) -> Vec<(Setting, Value)> {
    let mut all: Vec<(Setting, Value)> = Vec::new();
    let mut add = |setting: &Setting, value: Value| {
        if !all.iter().any(|known| known.0 == *setting && known.1 == value) {
            all.push((setting.clone(), value));
        }
    };
    for factor in design.factors() {
        let Some(setting) = &factor.setting else { continue };
        factor.values.iter().for_each(|value| add(setting, value.clone()));
    }
    let Some(stimulus) = design.stimulus() else { return all };
    let [least, most] = design.method().extremes().unwrap_or([0.0, 1.0]);
    // The standard may be a factor of any kind: try all levels of each factor alone.
    let with_level = |name: &str, value: &Value| Condition::from([(name.to_owned(), value.clone())]);
    let alone = design.factors().iter().flat_map(|factor| {
        factor.values.iter().map(|value| with_level(&factor.name, value)).collect::<Vec<_>>()
    });
    for condition in alone.chain([Condition::new()]) {
        for level in [least, 0.0, most] {
            if let Some(value) = design.value(&condition, level) {
                add(stimulus.setting(), value);
            }
        }
    }
    all
}

/// Apparatus of one session of a simulated subject.
pub struct DesignedRig<'a> {
    apparatus: &'a DesignedApparatus,
    sitting: Sitting,
    kinematics: Kinematics,
    files: Option<TrialFiles>,
    feel_s: f64,
    stop: StopSwitch,
    run: Option<Run>,
    watch: Watch,
}

/// Run with constant settings of the devices.
struct Run {
    steps: Steps,
    scene: Scene,
    seed: u64,
    /// Settings that need a new run.
    fixed: Settings,
    /// Settings of replaced models.
    replaced: Settings,
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
        let (stop, watch) = (stop.clone(), Watch::default());
        Self { apparatus, sitting, kinematics, files, feel_s, stop, run: None, watch }
    }

    /// Returns the settings that change in one way.
    fn of(&self, settings: &[(Setting, Value)], change: Change) -> Settings {
        let all = settings.iter().filter_map(|(setting, value)| match setting {
            Setting::Scene { part, key } if self.apparatus.change(setting) == change => {
                Some(((part.clone(), key.clone()), value.to_string()))
            }
            _ => None,
        });
        all.collect()
    }

    /// Starts a run, if settings of devices differ from those of the present one.
    fn begin(&mut self, settings: &[(Setting, Value)]) -> Result<(), ApparatusOrFrontEndError> {
        let fixed = self.of(settings, Change::NewRun);
        if self.run.as_ref().is_some_and(|run| run.fixed == fixed) {
            return Ok(());
        }
        // The earlier run ends first: a device has one run at a time.
        self.run = None;
        let Sitting { seed, subject, session } = self.sitting;
        let mut scene = self.apparatus.stage.scene_with_hand(seed, subject);
        for ((part, key), value) in &fixed {
            format!("{part}.{key}={value}").parse::<PluginKeyValue>()?.apply(&mut scene)?;
        }
        // A different seed for each subject and session, so that the tremor differs, too.
        let name = u64::from(subject.get()) + (u64::from(session) << 10);
        let seed = seed.wrapping_mul(1 << 20).wrapping_add(name);
        let steps = Steps::prepare(&scene, &self.apparatus.stage.registry, seed, &self.stop)?;
        self.run = Some(Run { steps, scene, seed, fixed, replaced: Settings::new() });
        Ok(())
    }

    /// Presents one interval: fades out what changes, changes it, fades it in, and waits while it is felt.
    fn feel(&mut self, settings: &[(Setting, Value)]) -> Result<(), ApparatusOrFrontEndError> {
        self.begin(settings)?;
        let (live, replaced) = (self.of(settings, Change::Live), self.of(settings, Change::Replacement));
        let mut parts: Vec<String> =
            live.keys().chain(replaced.keys()).map(|(part, _)| part.clone()).collect();
        parts.sort();
        parts.dedup();
        self.show(&parts, false)?;
        for part in &parts {
            let own = |settings: &Settings| -> Vec<(String, String)> {
                let own = settings.iter().filter(|((of, _), _)| of == part);
                own.map(|((_, key), value)| (key.clone(), value.clone())).collect()
            };
            let is_replaced = self.run.as_ref().is_some_and(|run| own(&run.replaced) != own(&replaced));
            if is_replaced {
                self.replace(part, &[own(&replaced), own(&live)].concat())?;
            } else {
                self.set(part, &own(&live))?;
            }
        }
        if let Some(run) = &mut self.run {
            run.replaced = replaced;
        }
        self.show(&parts, true)?;
        self.watch.meter = Some(KinematicsMeter::default());
        self.advance(self.feel_s)
    }

    /// Fades models in or out.
    fn show(&mut self, parts: &[String], shown: bool) -> Result<(), ApparatusOrFrontEndError> {
        let Some(run) = &self.run else { return Ok(()) };
        let mut longest_s = 0.0_f64;
        for model in run.scene.models.iter().filter(|model| parts.contains(&model.name)) {
            run.steps.controls().set_weight(&model.name, if shown { model.blend.weight } else { 0.0 })?;
            longest_s = longest_s.max(model.blend.fade_s);
        }
        // One tick more: the loop applies a change at the next tick.
        let tick_s = 1.0 / run.scene.rate_hz;
        if parts.is_empty() { Ok(()) } else { self.advance(longest_s + tick_s) }
    }

    fn set(&mut self, part: &str, values: &[(String, String)]) -> Result<(), ApparatusOrFrontEndError> {
        let Some(run) = &self.run else { return Ok(()) };
        let values: Vec<NewValue<'_>> =
            values.iter().map(|(parameter, value)| NewValue { plugin: part, parameter, value }).collect();
        if values.is_empty() {
            return Ok(());
        }
        Ok(run.steps.controls().set_parameters_at_once(&values)?)
    }

    fn replace(&mut self, part: &str, values: &[(String, String)]) -> Result<(), ApparatusOrFrontEndError> {
        let fade_s = self.run.as_ref().and_then(|run| {
            run.scene.models.iter().find(|model| model.name == part).map(|model| model.blend.fade_s)
        });
        let values: Vec<(&str, &str)> =
            values.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        let registry = &self.apparatus.stage.registry;
        let swap = |run: &Run| run.steps.controls().swap(registry, part, None, &values);
        let mut done = self.run.as_ref().map_or(Ok(()), swap);
        if let Err(ControlError::Busy) = done {
            // A replaced model is dropped after its fade-out; only then can another replacement start.
            self.advance(fade_s.unwrap_or(0.0))?;
            done = self.run.as_ref().map_or(Ok(()), swap);
        }
        Ok(done?)
    }

    fn advance(&mut self, seconds: f64) -> Result<(), ApparatusOrFrontEndError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // minutes at most
        let ticks = (seconds * run.scene.rate_hz).ceil() as u64;
        let end = run.steps.advance(ticks, &mut self.watch)?;
        if let Some(end) = end {
            return Err(RunEnded(end).into());
        }
        self.watch.refused.take().map_or(Ok(()), |change| Err(StimulusRefused(change).into()))
    }

    fn explore(
        &mut self,
        trial: &Trial,
        intervals: &[Vec<(Setting, Value)>],
    ) -> Result<Exploration, ApparatusOrFrontEndError> {
        if let Some(first) = intervals.first() {
            self.begin(first)?;
        }
        if let (Kinematics::Full, Some(files), Some(run)) = (self.kinematics, &self.files, &self.run) {
            let described = self.apparatus.stage.describe(&run.scene, Clock::Virtual, run.seed);
            let recorder = Recorder::create(&files.next_of_number(trial.number), &described)?;
            self.watch.recording = RunRecording::new(Some(recorder));
        }
        let mut exploration = Exploration::default();
        for settings in intervals {
            self.feel(settings)?;
            if let Some(meter) = self.watch.meter.take() {
                exploration.boundary_hit |= meter.out_of_range;
                if self.kinematics != Kinematics::None {
                    exploration.kinematics.extend(meter.finish());
                }
            }
        }
        exploration.missed_ticks = std::mem::take(&mut self.watch.missed_ticks);
        self.watch.recording.finish(&[])?;
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
