//! End of a run: its summary, and the sentence and exit code of the command line if it did not end in order.

use crate::error::sentence;
use flotor_command::{CommandError, end_notes, first_error, verdict};
use flotor_hal::Demand;
use flotor_record::Recorder;
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::summary::{RunFacts, RunSummary};
use flotor_session::{Measurements, Outcome, PluginReport, RunError, RunOptions, Session};
use std::path::Path;

/// Run that was prepared: its scene, options and plugins, for the summary at its end.
pub(crate) struct Prepared {
    pub(crate) scene: Scene,
    pub(crate) options: RunOptions,
    pub(crate) plugins: Vec<PluginReport>,
}

/// End of a run.
#[derive(Clone)]
pub(crate) struct Ended {
    /// Summary as JSON; `None` if there is none because the loop is stuck outside a plugin.
    pub(crate) summary: Option<String>,
    /// Sentence and exit code of the command line; `None` if all is well.
    pub(crate) problem: Option<(String, u8)>,
}

impl Prepared {
    /// Prepares a session, and its measurements with a recording to `recording` if given. Not real-time.
    pub(crate) fn new(
        scene: Scene,
        registry: &Registry,
        (clock, seed): (Clock, u64),
        recording: Option<&Path>,
    ) -> Result<(Self, Session, Measurements), CommandError> {
        let options = RunOptions { clock, seed };
        let session = Session::prepare(&scene, registry, &options)?;
        let plugins = session.plugins().to_vec();
        let recorder = recording.map(|path| Recorder::create(path, &describe(&scene, &options, &plugins)));
        let measured = Measurements::new(recorder.transpose()?, Demand::FORCE);
        Ok((Self { scene, options, plugins }, session, measured))
    }

    /// Finishes the recording of a run and frees its plugins. `notices`: notes from before the run. Not real-time.
    pub(crate) fn conclude(
        &self,
        mut measured: Measurements,
        ran: Result<Outcome, RunError>,
        notices: Vec<String>,
    ) -> Ended {
        let Self { scene, options, plugins } = self;
        let facts: RunFacts<'_> = measured.facts(scene, options, plugins);
        let (summary, result) = match ran {
            Ok(mut outcome) => {
                outcome.warnings.splice(0..0, notices);
                let summary = RunSummary::new(facts, &outcome, &measured.tally);
                let recorded = measured.recording.finish(&end_notes(&outcome, &summary)).map_err(Into::into);
                let verdict = verdict(&outcome, plugins, &summary);
                // Last, because plugin code may hang.
                let Outcome { unresponsive, unfreed_plugins, .. } = outcome;
                let freed = unresponsive.map_or_else(|| unfreed_plugins.free(), Err);
                let freed = freed.map_err(|hung| CommandError::PluginRefused(hung.to_string()));
                (Some(summary), first_error([verdict, freed, recorded]))
            }
            Err(error) => {
                let summary = match &error {
                    RunError::Hung { who, stuck, .. } => {
                        let outcome = Outcome::of_hung_loop(*stuck, measured.tally.last_ns());
                        let summary = RunSummary::new(facts, &outcome, &measured.tally);
                        Some(summary.with_health(who, &error.to_string()))
                    }
                    _ => None,
                };
                let recorded = measured.recording.finish(&[]).map_err(Into::into);
                (summary, first_error([Err(error.into()), recorded]))
            }
        };
        Ended {
            summary: summary.and_then(|summary| serde_json::to_string(&summary).ok()),
            problem: result.err().map(|error| (sentence(&error), error.exit_code())),
        }
    }
}
