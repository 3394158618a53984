//! Scene of a designed study, all of whose settings may be factors.

use super::ApparatusError;
use super::stage::{DURATION_S, Stage, UnreadableFile};
use crate::log::InputFile;
use flotor_hal::{Mutability, ParameterKind};
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::scene::{PluginKeyValue, Scene};
use flotor_session::{RunOptions, Session, Strength};
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::factor::Vary;
use flotor_study_design::stimulus::Stimulus;
use flotor_study_design::value::{Setting, Value};

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
pub(super) enum Change {
    /// Live number of a model.
    Live,
    /// Other setting of a model: the model is replaced.
    Replacement,
    /// Setting of a device: a new run begins.
    NewRun,
    /// The picture: nothing to feel.
    Unfelt,
}

/// Scene of a designed study, checked.
pub struct DesignedApparatus {
    pub(super) stage: Stage,
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

    /// Returns the files of plugins in shared libraries, with their hashes. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn plugin_files(&self) -> Result<Vec<InputFile>, UnreadableFile> {
        self.stage.plugin_files()
    }

    /// Estimates the disk space of a full recording, bytes per second.
    #[must_use]
    pub fn recording_bytes_per_s(&self) -> f64 {
        self.stage.recording_bytes_per_s()
    }

    /// Returns the first setting that a person's sitting cannot change in time; `None` if there is none. A setting of a device needs a
    /// new run, which a person notices: only a factor between blocks or subjects may set it.
    #[must_use]
    pub fn unfit_for_people(&self, design: &Design) -> Option<Setting> {
        let is_slow = |setting: &&Setting| self.change(setting) == Change::NewRun;
        let mixed = design
            .factors()
            .iter()
            .filter(|factor| factor.vary == Vary::Within && !design.blocks().by.contains(&factor.name));
        let mixed = mixed.filter_map(|factor| factor.setting.as_ref());
        design.stimulus().map(Stimulus::setting).into_iter().chain(mixed).find(is_slow).cloned()
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
    pub(super) fn change(&self, setting: &Setting) -> Change {
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
