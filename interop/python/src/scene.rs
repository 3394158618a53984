//! Scenes as Python passes them: a file, a text or the demo, with settings on top.

use crate::error::{refuse, refuse_run};
use flotor_core::LARGEST_SEED;
use flotor_session::RunError;
use flotor_session::registry::Registry;
use flotor_session::scene::{PluginKeyValue, Scene};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Scene of a run with its settings, from a dictionary of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct GivenScene {
    /// Scene file, or the name of one of Flotor's own scenes; the demo without file and text.
    scene: Option<PathBuf>,
    /// Text of the scene, in place of a file.
    text: Option<String>,
    /// Plugin folders in search order, after those of the scene.
    folders: Vec<PathBuf>,
    /// Duration, s, in place of that of the scene.
    duration_s: Option<f64>,
    /// Loop rate, Hz, in place of that of the scene.
    rate_hz: Option<f64>,
    /// Seed of all random numbers.
    seed: u64,
    /// Settings, each as `PLUGIN.KEY=VALUE`.
    settings: Vec<String>,
}

/// Largest duration of a run, s: a year.
const LONGEST_S: f64 = 31_536_000.0;

impl GivenScene {
    /// Reads the scene and applies the settings; returns scene, plugins and seed.
    pub(crate) fn read(self) -> PyResult<(Scene, Registry, u64)> {
        let Self { scene, text, mut folders, duration_s, rate_hz, seed, settings } = self;
        let mut scene = match (scene, text) {
            (Some(path), _) => Scene::load(&path),
            (None, Some(text)) => Scene::parse(Path::new("scene"), &text),
            (None, None) => Scene::demo(),
        }
        .map_err(|error| refuse_run(RunError::from(error)))?;
        if let Some(duration_s) = duration_s {
            let duration_s = if duration_s == f64::INFINITY { LONGEST_S } else { duration_s };
            scene.duration_s = legal("duration_s", duration_s, 0.0, LONGEST_S)?;
        }
        if let Some(rate_hz) = rate_hz {
            let rate_hz = legal("rate_hz", rate_hz, 100.0, 10_000.0)?;
            scene.set_rate(rate_hz, "rate_hz").map_err(refuse)?;
        }
        for setting in settings {
            let setting: PluginKeyValue = setting.parse().map_err(refuse)?;
            setting.apply(&mut scene).map_err(refuse)?;
        }
        folders.splice(0..0, scene.plugin_folders.iter().cloned());
        if seed > LARGEST_SEED {
            return Err(refuse(format!(
                "seed {seed} is larger than {LARGEST_SEED} (2^53); pass a smaller seed"
            )));
        }
        Ok((scene, Registry::search(&folders), seed))
    }
}

fn legal(name: &str, value: f64, min: f64, max: f64) -> PyResult<f64> {
    if (min..=max).contains(&value) {
        return Ok(value);
    }
    Err(refuse(format!("{name} = {value}: must be {min} to {max}")))
}
