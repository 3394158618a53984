//! Whole runs of scenes in virtual time, and the list of plugins.

use crate::ending::{Ended, Prepared};
use crate::error::refuse_run;
use crate::scene::GivenScene;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Summary of a run as JSON text, and sentence and exit code if it did not end in order.
pub(crate) type EndReport = (Option<String>, Option<(String, u8)>);

/// Returns id, kind, version and file of every plugin found; opens none.
#[pyfunction]
pub(crate) fn plugins(folders: Vec<PathBuf>) -> Vec<(String, &'static str, String, PathBuf)> {
    let registry = Registry::search(&folders);
    let found = registry.found().iter();
    found
        .map(|found| (found.id.clone(), found.kind.name(), found.version.clone(), found.path.clone()))
        .collect()
}

/// Runs a scene in virtual time to its end, without the GIL.
#[pyfunction]
pub(crate) fn run_scene(
    py: Python<'_>,
    given: GivenScene,
    recording: Option<PathBuf>,
) -> PyResult<EndReport> {
    py.detach(|| {
        let (scene, registry, seed) = given.read()?;
        let prepared = Prepared::new(scene, &registry, (Clock::Virtual, seed), recording.as_deref());
        let (prepared, session, mut measured) = prepared.map_err(refuse_run)?;
        let notices = session.notices();
        let ran = session.run(&mut measured, &StopSwitch::default());
        let Ended { summary, problem } = prepared.conclude(measured, ran, notices);
        Ok((summary, problem))
    })
}
