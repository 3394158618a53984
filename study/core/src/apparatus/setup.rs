//! The apparatus of an experiment: a scene, and the parameter of a model in it that is varied. Everything that can be
//! wrong with either is found before the first trial.

use crate::log::InputFile;
use crate::observer::HandManner;
use crate::protocol::{Protocol, ProtocolError, Stimulus, SubjectNumber};
use flotor_core::limits::CEILING;
use flotor_hal::{Mutability, Parameter, ParameterKind};
use flotor_record::{NamedFile, RunDescription};
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::run_description::{describe, named_files};
use flotor_session::scene::{Location, ModelUse, ParameterText, Scene, nearest};
use flotor_session::{
    ControlError, Controls, NewValue, PluginReport, RunError, RunOptions, Session, Strength, StrongDevice,
};
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// What is kept of how people moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kinematics {
    /// Every tick of every trial (MCAP), and the measures
    Full,
    /// Measures of each stimulus
    Summary,
    /// Nothing
    None,
}

/// Why an experiment cannot be carried out on a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ApparatusError {
    /// The scene, a plugin, or what the device cannot do.
    #[error(transparent)]
    Run(#[from] RunError),
    /// No model of the scene has this name.
    #[error(
        "stimulus {stimulus}: the scene has no model `{}`{} (it has {})",
        stimulus.model, nearest.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")),
        models.join(", ")
    )]
    NoModel {
        /// The requested name.
        stimulus: Stimulus,
        /// The most similar name there is.
        nearest: Option<String>,
        /// All names.
        models: Vec<String>,
    },
    /// The model has no such number.
    #[error(
        "stimulus {stimulus}: `{}` has no number `{}`{} (it has {})",
        stimulus.model, stimulus.parameter,
        nearest.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")), numbers.join(", ")
    )]
    NoParameter {
        /// The requested name.
        stimulus: Stimulus,
        /// The most similar id there is.
        nearest: Option<String>,
        /// All numbers.
        numbers: Vec<String>,
    },
    /// A file of the scene cannot be read any more.
    #[error("{}: {cause}; the file was there a moment ago: start again", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Message of the system.
        #[source]
        cause: io::Error,
    },
    /// A stimulus outside the range of its parameter.
    #[error(transparent)]
    Range(#[from] ProtocolError),
    /// The model refuses one of the stimuli.
    #[error("stimulus {stimulus} = {value}: {cause}")]
    Refused {
        /// What is varied.
        stimulus: Stimulus,
        /// The value.
        value: f64,
        /// What the model said.
        cause: Box<RunError>,
    },
    /// The ceiling of the host could cut a stimulus off, and nobody would see it in the answers.
    #[error(
        "{device}, and the host sends at most {} N and {} N·m: a stimulus above that would be felt as another. Set `[limits] force_n` and `torque_nm` to no more than that, or give `--allow-strong`",
        CEILING.force_n, CEILING.torque_nm
    )]
    HeldBack {
        /// It.
        device: StrongDevice,
    },
    /// A simulated observer needs a hand to feel with.
    #[error(
        "the device `{device}` has no simulated hand for simulated observers (it lacks `{missing}`); use --observer human, a scene with the device `simulated`, or --apparatus none"
    )]
    NoHand {
        /// The device.
        device: String,
        /// The parameter it lacks.
        missing: &'static str,
    },
}

/// How a stimulus gets into a running model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Route {
    /// The parameter is live.
    Parameter,
    /// It is read when the model is made: a new model takes the place of the old.
    Swap,
}

/// A scene to judge, checked.
pub struct Apparatus {
    scene: Scene,
    registry: Registry,
    stimulus: Stimulus,
    route: Route,
    /// The model's part of the wrench while it is felt, and the time it takes to come and go, s.
    weight: f64,
    fade_s: f64,
    plugins: Vec<PluginReport>,
    strength: Strength,
    notices: Vec<String>,
}

/// The scene runs as long as the experiment lasts.
const DURATION_S: f64 = 31_536_000.0;

/// A parameter of the device, and what a hand has to say to it.
type HandParameter = (&'static str, fn(&HandManner) -> f64);

/// What a hand is told, by parameter of the device.
const HAND: [HandParameter; 5] = [
    ("hand_frequency_hz", |hand| hand.frequency_hz),
    ("hand_centre_mm", |hand| hand.centre_m * 1.0e3),
    ("hand_amplitude_mm", |hand| hand.amplitude_m * 1.0e3),
    ("hand_stiffness_n_per_m", |hand| hand.stiffness_n_per_m),
    ("hand_tremor_um", |hand| hand.tremor_m * 1.0e6),
];

impl Apparatus {
    /// Checks an experiment against a scene: the model and its parameter exist, every stimulus is in range and taken,
    /// and the device can do what the scene wants. Not real-time; nothing is energised.
    ///
    /// # Errors
    /// [`ApparatusError`], the first thing that cannot be.
    pub fn check(scene: Scene, protocol: &Protocol) -> Result<Self, ApparatusError> {
        Self::check_with(scene, protocol, Strength::UnderCeiling)
    }

    /// The same on devices of a strength. Where more than the host's ceiling could be commanded and is not allowed, the
    /// experiment is refused. Not real-time; nothing is energised.
    ///
    /// # Errors
    /// [`ApparatusError`], the first thing that cannot be.
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
        let session =
            Session::prepare(&scene, &registry, &options(Clock::Virtual, 0))?.with_strength(strength);
        if let Some(device) = session.held_back().first() {
            return Err(ApparatusError::HeldBack { device: device.clone() });
        }
        let (plugins, notices) = (session.plugins().to_vec(), session.notices());
        drop(session);
        let schema = plugins.iter().skip(1).find(|plugin| plugin.name == name);
        let parameter = find_number(schema.map_or(&[], |plugin| plugin.schema), &stimulus)?;
        protocol.check_range(parameter.min(), parameter.max())?;
        let route = match parameter.mutability() {
            Mutability::Live => Route::Parameter,
            Mutability::Fixed => Route::Swap,
        };
        let stimulus = Stimulus { model: name, ..stimulus };
        let apparatus = Self { scene, registry, stimulus, route, weight, fade_s, plugins, strength, notices };
        for value in protocol.extremes() {
            let scene = apparatus.with_stimulus(value);
            let refused = |cause| ApparatusError::Refused {
                stimulus: apparatus.stimulus.clone(),
                value,
                cause: Box::new(cause),
            };
            Session::prepare(&scene, &apparatus.registry, &options(Clock::Virtual, 0)).map_err(refused)?;
        }
        Ok(apparatus)
    }

    /// What a person should know of the limits before the first trial, a line each.
    #[must_use]
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// How strong its devices may be.
    pub(super) fn strength(&self) -> Strength {
        self.strength
    }

    /// Whether the first device has a hand a simulated observer can feel with.
    ///
    /// # Errors
    /// [`ApparatusError::NoHand`].
    pub fn check_hand(&self) -> Result<(), ApparatusError> {
        let schema = self.plugins.first().map_or(&[][..], |device| device.schema);
        let lacks = |id: &&'static str| !schema.iter().any(|parameter| parameter.id() == *id);
        let missing = HAND.iter().map(|(id, _)| *id).find(lacks);
        missing.map_or(Ok(()), |missing| {
            let device =
                self.scene.devices.first().map_or_else(String::new, |device| device.plugin.plugin.clone());
            Err(ApparatusError::NoHand { device, missing })
        })
    }

    /// Everything that decides what is felt, for the log: scene, settings, plugins with their versions.
    #[must_use]
    pub fn description(&self) -> Value {
        let plugin = |plugin: &PluginReport| {
            json!({
                "name": plugin.name, "id": plugin.metadata.id, "version": plugin.metadata.version,
                "settings": plugin.settings,
            })
        };
        json!({
            "scene": self.scene.text, "rate_hz": self.scene.rate_hz,
            "plugins": self.plugins.iter().map(plugin).collect::<Vec<_>>(),
        })
    }

    /// Files that settings of the scene name, by their content. Not real-time: reads them.
    ///
    /// # Errors
    /// One of them cannot be read any more.
    pub fn input_files(&self) -> Result<Vec<InputFile>, ApparatusError> {
        let named = self.plugins.iter().flat_map(|plugin| {
            named_files(plugin).map(move |(parameter, path)| (format!("{}.{parameter}", plugin.name), path))
        });
        named.map(|(used_as, path)| input(used_as, &path)).collect()
    }

    /// Files of the plugins, by their content: another build of one version is another stimulus. Not real-time: reads them.
    ///
    /// # Errors
    /// One of them cannot be read any more.
    pub fn plugin_files(&self) -> Result<Vec<InputFile>, ApparatusError> {
        let in_files = self.plugins.iter().filter(|plugin| !plugin.metadata.path.as_os_str().is_empty());
        in_files.map(|plugin| input(plugin.name.clone(), &plugin.metadata.path)).collect()
    }

    /// What a second of fully recorded movement takes on disk, bytes, about: 466 a tick were measured with one device.
    #[must_use]
    pub fn recording_bytes_per_s(&self) -> f64 {
        470.0 * self.scene.rate_hz * self.scene.devices.len() as f64
    }

    /// What is varied.
    #[must_use]
    pub fn stimulus(&self) -> &Stimulus {
        &self.stimulus
    }

    /// Whether the stimuli change by new models rather than by live parameters.
    #[must_use]
    pub fn swaps_models(&self) -> bool {
        self.route == Route::Swap
    }

    pub(super) fn registry(&self) -> &Registry {
        &self.registry
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene with the hand of a simulated subject.
    pub(super) fn scene_with_hand(&self, seed: u64, subject: SubjectNumber) -> Scene {
        let hand = HandManner::of(seed, subject);
        let mut scene = self.scene.clone();
        // In front: what a scene or a person has set stays.
        let parameters = HAND.iter().map(|(id, value)| text(id, value(&hand)));
        if let Some(device) = scene.devices.first_mut() {
            device.plugin.parameters.splice(0..0, parameters);
        }
        scene
    }

    /// What a recording says of the run.
    pub(super) fn describe(&self, scene: &Scene, clock: Clock, seed: u64) -> RunDescription {
        describe(scene, &options(clock, seed), &self.plugins)
    }

    /// Time the object takes to come or to go, s.
    pub(super) fn fade_s(&self) -> f64 {
        self.fade_s
    }

    /// Lets the object come or go.
    pub(super) fn show(&self, controls: &Controls, shown: bool) -> Result<(), ControlError> {
        controls.set_weight(&self.stimulus.model, if shown { self.weight } else { 0.0 })
    }

    /// Gives the object its next value; it should have gone before.
    pub(super) fn set(&self, controls: &Controls, value: f64) -> Result<(), ControlError> {
        let Stimulus { model, parameter } = &self.stimulus;
        let value = value.to_string();
        match self.route {
            Route::Parameter => {
                controls.set_parameters_at_once(&[NewValue { plugin: model, parameter, value: &value }])
            }
            Route::Swap => controls.swap(&self.registry, model, None, &[(parameter, &value)]),
        }
    }

    fn with_stimulus(&self, value: f64) -> Scene {
        let mut scene = self.scene.clone();
        if let Some(model) = scene.models.iter_mut().find(|model| model.name == self.stimulus.model) {
            model.plugin.parameters.push(text(&self.stimulus.parameter, value));
        }
        scene
    }
}

fn input(used_as: String, path: &Path) -> Result<InputFile, ApparatusError> {
    let unreadable = |cause| ApparatusError::Unreadable { path: path.to_path_buf(), cause };
    let file = NamedFile::read(path).map_err(unreadable)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(InputFile { used_as, name, hash: file.hash_text() })
}

fn options(clock: Clock, seed: u64) -> RunOptions {
    RunOptions { clock, seed }
}

fn text(key: &str, value: f64) -> ParameterText {
    let location = Location { file: PathBuf::from("the study"), line: 0 };
    ParameterText { key: key.to_owned(), value: value.to_string(), location }
}

/// The model of a name, or of a plugin's id.
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
