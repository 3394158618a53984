//! Runs of scenes in virtual time, and the list of plugins.

use crate::error::refuse;
use flotor_core::LARGEST_SEED;
use flotor_hal::Demand;
use flotor_session::registry::Registry;
use flotor_session::scene::{PluginKeyValue, Scene};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Returns id, kind, version and file of every plugin found; opens none.
#[pyfunction]
pub(crate) fn plugins(folders: Vec<PathBuf>) -> Vec<(String, &'static str, String, PathBuf)> {
    let registry = Registry::search(&folders);
    let found = registry.found().iter();
    found
        .map(|found| (found.id.clone(), found.kind.name(), found.version.clone(), found.path.clone()))
        .collect()
}

/// Runs a scene (from its file or its text; the demo without both) in virtual time; returns the summary of `flotor run --json` as JSON text.
#[pyfunction]
#[pyo3(signature = (scene, *, text, folders, duration_s, rate_hz, seed, settings, recording))]
#[allow(clippy::too_many_arguments)] // keyword arguments of Python
pub(crate) fn run_scene(
    py: Python<'_>,
    scene: Option<PathBuf>,
    text: Option<String>,
    folders: Vec<PathBuf>,
    duration_s: Option<f64>,
    rate_hz: Option<f64>,
    seed: u64,
    settings: Vec<String>,
    recording: Option<PathBuf>,
) -> PyResult<String> {
    let mut scene = match (scene, text) {
        (Some(path), _) => Scene::load(&path),
        (None, Some(text)) => Scene::parse(Path::new("scene"), &text),
        (None, None) => Scene::demo(),
    }
    .map_err(refuse)?;
    if let Some(duration_s) = duration_s {
        scene.duration_s = legal("duration_s", duration_s, 0.0, 31_536_000.0)?;
    }
    if let Some(rate_hz) = rate_hz {
        let rate_hz = legal("rate_hz", rate_hz, 100.0, 10_000.0)?;
        scene.set_rate(rate_hz, "rate_hz").map_err(refuse)?;
    }
    for setting in settings {
        let setting: PluginKeyValue = setting.parse().map_err(refuse)?;
        setting.apply(&mut scene).map_err(refuse)?;
    }
    let mut folders = folders;
    folders.splice(0..0, scene.plugin_folders.iter().cloned());
    let registry = Registry::search(&folders);
    if seed > LARGEST_SEED {
        return Err(refuse(format!("seed {seed} is larger than {LARGEST_SEED} (2^53); pass a smaller seed")));
    }
    let run = || flotor_session::headless::run(&scene, &registry, seed, recording.as_deref(), Demand::FORCE);
    let summary = py.detach(run);
    serde_json::to_string(&summary.map_err(refuse)?).map_err(refuse)
}

fn legal(name: &str, value: f64, min: f64, max: f64) -> PyResult<f64> {
    if (min..=max).contains(&value) {
        return Ok(value);
    }
    Err(refuse(format!("{name} = {value}: must be {min} to {max}")))
}
