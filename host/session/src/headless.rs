//! A scene in virtual time from start to end, with nobody watching: for sweeps, studies and other programs.

use crate::registry::Registry;
use crate::run_description::describe;
use crate::scene::Scene;
use crate::summary::{RunFacts, RunSummary, Tally};
use crate::{Observer, RunError, RunOptions, RunRecording, Session};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::{RecordError, Recorder, TraceDigest};
use flotor_servo::{Clock, StopSwitch};
use std::path::Path;

/// Why a scene did not run, or its recording is not whole.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HeadlessError {
    /// It did not start.
    #[error(transparent)]
    Run(#[from] RunError),
    /// It ran, and could not be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
}

/// Runs a scene as fast as it goes, with `demand` and what the recording stores asked of its models; equal scenes and seeds give
/// equal digests. Not real-time.
///
/// # Errors
/// [`HeadlessError`]. A device that faults is no error: the summary says so in `end`.
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
    let recording = RunRecording::new(recorder);
    let mut watchers = Watchers { tally: Tally::default(), digest: TraceDigest::new(), recording, demand };
    let ran = session.run(&mut watchers, &StopSwitch::default());
    let asked = watchers.demand();
    let Watchers { tally, digest, mut recording, .. } = watchers;
    // Also that of a run which did not end well.
    let recorded = recording.finish(&[]);
    let mut outcome = ran?;
    recorded?;
    // Nobody was there to be told before.
    outcome.warnings.splice(0..0, notices);
    let facts = RunFacts {
        title: &scene.title,
        clock: "virtual",
        seed,
        rate_hz: scene.rate_hz,
        plugins: &plugins,
        asked,
        couplings: &scene.couplings,
        carried: &[],
        trace_digest: digest.finish(),
    };
    Ok(RunSummary::new(facts, &outcome, &tally))
}

struct Watchers {
    tally: Tally,
    digest: TraceDigest,
    recording: RunRecording,
    demand: Demand,
}

impl Observer for Watchers {
    fn change(&mut self, change: &Change) {
        self.recording.change(change);
    }

    fn observe(&mut self, record: &TickRecord) {
        self.tally.observe(record);
        self.digest.update(record);
        self.recording.observe(record);
    }

    fn demand(&self) -> Demand {
        self.demand.with(self.recording.demand())
    }
}
