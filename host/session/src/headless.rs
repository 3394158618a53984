//! Headless runs: whole runs of a scene in virtual time, for sweeps, studies and other programs.

use crate::registry::Registry;
use crate::run_description::describe;
use crate::scene::Scene;
use crate::summary::RunSummary;
use crate::{Measurements, RunError, RunOptions, Session};
use flotor_hal::Demand;
use flotor_record::{RecordError, Recorder};
use flotor_servo::{Clock, StopSwitch};
use std::path::Path;

/// Reason why a headless run failed or was not recorded completely.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HeadlessError {
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The recording failed.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// Runs a scene in virtual time, as fast as possible, records it to `recording` if given, and returns the summary. The models compute
/// at least the outputs in `demand`, and all outputs for a recording. Equal scenes and seeds give equal digests. Not real-time.
///
/// # Errors
/// [`HeadlessError`]. A device fault is not an error: the summary reports it in `end`.
pub fn run(
    scene: &Scene,
    registry: &Registry,
    seed: u64,
    recording: Option<&Path>,
    demand: Demand,
) -> Result<RunSummary, HeadlessError> {
    let options = RunOptions { clock: Clock::Virtual, seed };
    let session = Session::prepare(scene, registry, &options)?;
    let (plugins, notices) = (session.plugins().to_vec(), session.notices());
    let recorder =
        recording.map(|path| Recorder::create(path, &describe(scene, &options, &plugins))).transpose()?;
    let mut measured = Measurements::new(recorder, demand);
    let ran = session.run(&mut measured, &StopSwitch::default());
    let facts = measured.facts(scene, &options, &plugins);
    // The recording of a failed run is finished, too.
    let recorded = measured.recording.finish(&[]);
    let mut outcome = ran?;
    recorded?;
    // A headless run has shown no notices before its start.
    outcome.warnings.splice(0..0, notices);
    Ok(RunSummary::new(facts, &outcome, &measured.tally))
}
