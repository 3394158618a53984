//! Measurements of a run for its report: statistics, digest and recording.

use crate::run_recording::RunRecording;
use crate::scene::Scene;
use crate::summary::{RunFacts, Tally};
use crate::{Observer, PluginReport, RunOptions};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::{Recorder, TraceDigest};

/// Observer that measures a run for its report.
pub struct Measurements {
    /// Tick statistics.
    pub tally: Tally,
    /// Recording of the run, if one is requested.
    pub recording: RunRecording,
    digest: TraceDigest,
    requested: Demand,
}

impl Measurements {
    /// Creates the measurements before a run; `requested` are the model outputs to compute beside those that are recorded.
    #[must_use]
    pub fn new(recorder: Option<Recorder>, requested: Demand) -> Self {
        let (tally, digest) = (Tally::default(), TraceDigest::new());
        Self { tally, recording: RunRecording::new(recorder), digest, requested }
    }

    /// Returns the inputs of the summary so far, without messages between hosts; called before the recording is finished.
    #[must_use]
    pub fn facts<'a>(
        &self,
        scene: &'a Scene,
        options: &'a RunOptions,
        plugins: &'a [PluginReport],
    ) -> RunFacts<'a> {
        let (requested, trace_digest) = (self.demand(), self.digest.finish());
        RunFacts { scene, options, plugins, requested, carried: &[], trace_digest }
    }
}

impl Observer for Measurements {
    fn change(&mut self, change: &Change) {
        self.recording.change(change);
    }

    fn observe(&mut self, record: &TickRecord) {
        self.tally.observe(record);
        self.digest.update(record);
        self.recording.observe(record);
    }

    fn demand(&self) -> Demand {
        self.requested.with(self.recording.demand())
    }
}
