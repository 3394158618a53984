//! Apparatus of an experiment: a scene and the varied parameter of one of its models, both checked before the first trial.

use super::stage::{DURATION_S, Stage, UnreadableFile, text};
use crate::log::InputFile;
use crate::protocol::{Protocol, ProtocolError, Stimulus};
use flotor_core::limits::CEILING;
use flotor_hal::{Mutability, Parameter, ParameterKind};
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::scene::{ModelUse, Scene, nearest};
use flotor_session::{
    ControlError, Controls, NewValue, RunError, RunOptions, Session, Strength, StrongDevice,
};
use serde_json::Value;

/// Movement data to store.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kinematics {
    /// Every tick of every trial (MCAP), and the movement measures of each stimulus
    Full,
    /// Movement measures of each stimulus
    Summary,
    /// No movement data
    None,
}

/// Error of setting up an experiment on a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ApparatusError {
    /// Error of the scene, a plugin, or the device.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The scene has no model of this name.
    #[error(
        "stimulus {stimulus}: the scene has no model `{}`{} (its models: {})",
        stimulus.model, nearest.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")),
        listed(models)
    )]
    NoModel {
        /// The stimulus as requested.
        stimulus: Stimulus,
        /// Most similar model name; `None` if no name is similar.
        nearest: Option<String>,
        /// All model names.
        models: Vec<String>,
    },
    /// The model has no real parameter of this id.
    #[error(
        "stimulus {stimulus}: `{}` has no numeric parameter `{}`{} (numeric parameters: {})",
        stimulus.model, stimulus.parameter,
        nearest.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")), listed(numbers)
    )]
    NoParameter {
        /// The stimulus as requested.
        stimulus: Stimulus,
        /// Most similar parameter id; `None` if no id is similar.
        nearest: Option<String>,
        /// Ids of all real parameters.
        numbers: Vec<String>,
    },
    /// A file of the scene or of a plugin has become unreadable.
    #[error(transparent)]
    Unreadable(#[from] UnreadableFile),
    /// A stimulus outside the range of its parameter.
    #[error(transparent)]
    Range(#[from] ProtocolError),
    /// The model rejects one of the stimuli.
    #[error("stimulus {stimulus} = {value}: {cause}")]
    Refused {
        /// The varied parameter.
        stimulus: Stimulus,
        /// Rejected value, in the parameter's unit.
        value: f64,
        /// Error of the model.
        cause: Box<RunError>,
    },
    /// The host's force ceiling could limit a stimulus, which the answers would not reveal.
    #[error(
        "{device}, and the host sends at most {} N and {} N·m: the host would limit a stronger stimulus. Set \
         `[limits] force_n` and `torque_nm` to at most these values, or add `--allow-strong`",
        CEILING.force_n, CEILING.torque_nm
    )]
    ExceedsForceCeiling {
        /// Device with force or torque limits above the ceiling.
        device: StrongDevice,
    },
    /// The device has no simulated hand for a simulated observer.
    #[error(
        "the device `{device}` has no simulated hand for simulated observers (it lacks `{missing}`); use --observer human, a scene with the device `simulated`, or --apparatus none"
    )]
    NoHand {
        /// Plugin name of the device.
        device: String,
        /// Id of the missing parameter.
        missing: &'static str,
    },
}

/// Joins names for an error.
fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Checked scene with its varied stimulus.
pub struct Apparatus {
    pub(super) stage: Stage,
    stimulus: Stimulus,
    /// Mutability of the varied parameter: a fixed parameter changes by replacement of its model (hot swap).
    mutability: Mutability,
    /// Blend weight of the model while it is felt, 0 to 1; below, its fade time, s.
    weight: f64,
    pub(super) fade_s: f64,
    notices: Vec<String>,
}

impl Apparatus {
    /// Checks an experiment against a scene: model and parameter exist, the model accepts the smallest and largest stimulus,
    /// and the device supports the scene. Not real-time; energises nothing.
    ///
    /// # Errors
    /// The first [`ApparatusError`] found.
    pub fn check(scene: Scene, protocol: &Protocol) -> Result<Self, ApparatusError> {
        Self::check_with(scene, protocol, Strength::UnderCeiling)
    }

    /// Checks as [`Self::check`] does. `strength` permits or rejects devices with limits above the host's force ceiling;
    /// [`Self::check`] rejects them. Not real-time; energises nothing.
    ///
    /// # Errors
    /// The first [`ApparatusError`] found.
    pub fn check_with(
        mut scene: Scene,
        protocol: &Protocol,
        strength: Strength,
    ) -> Result<Self, ApparatusError> {
        scene.duration_s = DURATION_S;
        let registry = Registry::search(&scene.plugin_folders);
        let stimulus = protocol.stimulus().clone();
        let model = find_model(&scene, &stimulus)?;
        let (weight, fade_s, name) = (model.blend.weight, model.blend.fade_s, model.name.clone());
        let options = RunOptions { clock: Clock::Virtual, seed: 0 };
        let session = Session::prepare(&scene, &registry, &options)?.with_strength(strength);
        if let Some(device) = session.held_back().first() {
            return Err(ApparatusError::ExceedsForceCeiling { device: device.clone() });
        }
        let (plugins, notices) = (session.plugins().to_vec(), session.notices());
        drop(session);
        let schema = plugins.iter().skip(1).find(|plugin| plugin.name == name);
        let parameter = find_number(schema.map_or(&[], |plugin| plugin.schema), &stimulus)?;
        protocol.check_range(parameter.min(), parameter.max())?;
        let mutability = parameter.mutability();
        let stimulus = Stimulus { model: name, ..stimulus };
        let stage = Stage { scene, registry, plugins, strength };
        let apparatus = Self { stage, stimulus, mutability, weight, fade_s, notices };
        for value in protocol.extremes() {
            let scene = apparatus.with_stimulus(value);
            let refused = |cause| ApparatusError::Refused {
                stimulus: apparatus.stimulus.clone(),
                value,
                cause: Box::new(cause),
            };
            let prepared = Session::prepare(&scene, &apparatus.stage.registry, &options);
            drop(prepared.map_err(refused)?);
        }
        Ok(apparatus)
    }

    /// Returns the notices about force limits, one line each, to be shown before the first trial.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Checks that the first device has all parameters of a simulated hand.
    ///
    /// # Errors
    /// [`ApparatusError::NoHand`].
    pub fn check_hand(&self) -> Result<(), ApparatusError> {
        let missing = self.stage.missing_hand_parameter();
        missing.map_or(Ok(()), |missing| Err(ApparatusError::NoHand { device: self.stage.device(), missing }))
    }

    /// Returns the configuration that determines the stimuli, for the log: scene, servo rate, and plugins with version and
    /// settings.
    #[must_use]
    pub fn description(&self) -> Value {
        self.stage.description()
    }

    /// Returns the files named by settings of the scene, with their hashes. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn input_files(&self) -> Result<Vec<InputFile>, ApparatusError> {
        Ok(self.stage.input_files()?)
    }

    /// Returns the files of plugins in shared libraries, with their hashes: another build of the same version may present
    /// another stimulus. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn plugin_files(&self) -> Result<Vec<InputFile>, ApparatusError> {
        Ok(self.stage.plugin_files()?)
    }

    /// Estimates the disk space of a full recording, bytes per second.
    #[must_use]
    pub fn recording_bytes_per_s(&self) -> f64 {
        self.stage.recording_bytes_per_s()
    }

    /// Returns the varied parameter.
    #[must_use]
    pub fn stimulus(&self) -> &Stimulus {
        &self.stimulus
    }

    /// Returns true if stimuli change by model replacement instead of live parameters.
    #[must_use]
    pub fn swaps_models(&self) -> bool {
        self.mutability == Mutability::Fixed
    }

    /// Starts to fade the object in (`shown`) or out.
    pub(super) fn show(&self, controls: &Controls, shown: bool) -> Result<(), ControlError> {
        controls.set_weight(&self.stimulus.model, if shown { self.weight } else { 0.0 })
    }

    /// Changes the stimulus to `value`; the object should be faded out.
    pub(super) fn set(&self, controls: &Controls, value: f64) -> Result<(), ControlError> {
        let Stimulus { model, parameter } = &self.stimulus;
        let value = value.to_string();
        match self.mutability {
            Mutability::Live => {
                controls.set_parameters_at_once(&[NewValue { plugin: model, parameter, value: &value }])
            }
            Mutability::Fixed => controls.swap(&self.stage.registry, model, None, &[(parameter, &value)]),
        }
    }

    fn with_stimulus(&self, value: f64) -> Scene {
        let mut scene = self.stage.scene.clone();
        if let Some(model) = scene.models.iter_mut().find(|model| model.name == self.stimulus.model) {
            model.plugin.parameters.push(text(&self.stimulus.parameter, value));
        }
        scene
    }
}

/// Finds the model of the stimulus by its name in the scene, else by its plugin's id.
fn find_model<'s>(scene: &'s Scene, stimulus: &Stimulus) -> Result<&'s ModelUse, ApparatusError> {
    let models = &scene.models;
    let by_name = models.iter().find(|model| model.name == stimulus.model);
    by_name.or_else(|| models.iter().find(|model| model.plugin.plugin == stimulus.model)).ok_or_else(|| {
        let names = || models.iter().map(|model| model.name.as_str());
        ApparatusError::NoModel {
            stimulus: stimulus.clone(),
            nearest: nearest(&stimulus.model, names()).map(str::to_owned),
            models: names().map(str::to_owned).collect(),
        }
    })
}

fn find_number<'s>(schema: &'s [Parameter], stimulus: &Stimulus) -> Result<&'s Parameter, ApparatusError> {
    let numbers = || schema.iter().filter(|known| known.kind() == ParameterKind::Real);
    numbers().find(|known| known.id() == stimulus.parameter).ok_or_else(|| ApparatusError::NoParameter {
        stimulus: stimulus.clone(),
        nearest: nearest(&stimulus.parameter, numbers().map(Parameter::id)).map(str::to_owned),
        numbers: numbers().map(|known| known.id().to_owned()).collect(),
    })
}
