//! Scene of an experiment with its plugins, for any kind of stimulus.

use crate::log::InputFile;
use crate::observer::HandManner;
use flotor_record::{NamedFile, RunDescription};
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::run_description::{describe, named_files};
use flotor_session::scene::{Location, ParameterText, Scene};
use flotor_session::{PluginReport, RunOptions, Strength};
use flotor_study_design::subject::SubjectNumber;
use serde_json::{Value, json};
use std::io;
use std::path::{Path, PathBuf};

/// Error: a file of the scene or of a plugin has become unreadable.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}; the file was readable at the start: restore the file and start again", path.display())]
pub struct UnreadableFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Message of the system.
    #[source]
    pub cause: io::Error,
}

/// Duration of the run, s: a year, longer than any experiment.
pub(super) const DURATION_S: f64 = 31_536_000.0;

/// Parameter id of the device, and conversion of a hand's movement to the parameter's value.
type HandParameter = (&'static str, fn(&HandManner) -> f64);

/// Settings of the simulated hand, by parameter id of the device.
const HAND: [HandParameter; 5] = [
    ("hand_frequency_hz", |hand| hand.frequency_hz),
    ("hand_centre_mm", |hand| hand.centre_m * 1.0e3),
    ("hand_amplitude_mm", |hand| hand.amplitude_m * 1.0e3),
    ("hand_stiffness_n_per_m", |hand| hand.stiffness_n_per_m),
    ("hand_tremor_um", |hand| hand.tremor_m * 1.0e6),
];

/// Scene with its plugins.
pub(super) struct Stage {
    pub(super) scene: Scene,
    pub(super) registry: Registry,
    pub(super) plugins: Vec<PluginReport>,
    /// Permission for devices with limits above the host's force ceiling.
    pub(super) strength: Strength,
}

impl Stage {
    /// Returns the first parameter of a simulated hand that the first device lacks; `None` if it has all.
    pub(super) fn missing_hand_parameter(&self) -> Option<&'static str> {
        let schema = self.plugins.first().map_or(&[][..], |device| device.schema);
        let lacks = |id: &&'static str| !schema.iter().any(|parameter| parameter.id() == *id);
        HAND.iter().map(|(id, _)| *id).find(lacks)
    }

    /// Returns the plugin of the first device.
    pub(super) fn device(&self) -> String {
        self.scene.devices.first().map_or_else(String::new, |device| device.plugin.plugin.clone())
    }

    /// Returns the configuration that determines the stimuli, for the log: scene, servo rate, and plugins with version and
    /// settings.
    pub(super) fn description(&self) -> Value {
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

    /// Returns the files named by settings of the scene, with their hashes. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn input_files(&self) -> Result<Vec<InputFile>, UnreadableFile> {
        let named = self.plugins.iter().flat_map(|plugin| {
            named_files(plugin).map(move |(parameter, path)| (format!("{}.{parameter}", plugin.name), path))
        });
        named.map(|(used_as, path)| input(used_as, &path)).collect()
    }

    /// Returns the files of plugins in shared libraries, with their hashes: another build of the same version may present
    /// another stimulus. Not real-time: reads the files.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn plugin_files(&self) -> Result<Vec<InputFile>, UnreadableFile> {
        let in_files = self.plugins.iter().filter(|plugin| !plugin.metadata.path.as_os_str().is_empty());
        in_files.map(|plugin| input(plugin.name.clone(), &plugin.metadata.path)).collect()
    }

    /// Returns the scene with the hand parameters of a simulated subject.
    pub(super) fn scene_with_hand(&self, seed: u64, subject: SubjectNumber) -> Scene {
        let hand = HandManner::of(seed, subject);
        let mut scene = self.scene.clone();
        // Insert at the front, so that settings of the scene or the command line take precedence.
        let parameters = HAND.iter().map(|(id, value)| text(id, value(&hand)));
        if let Some(device) = scene.devices.first_mut() {
            device.plugin.parameters.splice(0..0, parameters);
        }
        scene
    }

    /// Estimates the disk space of a full recording, bytes per second (measured: 466 bytes per tick with one device).
    pub(super) fn recording_bytes_per_s(&self) -> f64 {
        470.0 * self.scene.rate_hz * self.scene.devices.len() as f64
    }

    /// Returns the description of the run for a recording.
    pub(super) fn describe(&self, scene: &Scene, clock: Clock, seed: u64) -> RunDescription {
        describe(scene, &RunOptions { clock, seed }, &self.plugins)
    }
}

fn input(used_as: String, path: &Path) -> Result<InputFile, UnreadableFile> {
    let unreadable = |cause| UnreadableFile { path: path.to_path_buf(), cause };
    let file = NamedFile::read(path).map_err(unreadable)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(InputFile { used_as, name, hash: file.hash_text() })
}

pub(super) fn text(key: &str, value: f64) -> ParameterText {
    let location = Location { file: PathBuf::from("the study"), line: 0 };
    ParameterText { key: key.to_owned(), value: value.to_string(), location }
}
