//! State of all models of a replay before a tick, to start another replay there.

use super::error::ReplayError;
use super::snapshot::{Snapshot, SnapshotError, SnapshotOrigin};
use flotor_hal::LoopConfig;
use flotor_hal::abi::CallStatus;
use flotor_loader::InstanceState;
use flotor_servo::Forces;
use flotor_session::PluginReport;
use serde::{Deserialize, Serialize};

/// State of all models of a replay before a tick, after the changes of that tick.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReplayState {
    /// First tick of a replay that starts with this state.
    pub tick: u64,
    /// State of each instance, in the order of [`Forces::states`].
    instances: Vec<Snapshot>,
}

/// Models with their reports, in a loop: what a state belongs to.
pub(super) struct Models<'m> {
    pub(super) forces: &'m mut Forces,
    pub(super) reports: &'m [PluginReport],
    pub(super) config: &'m LoopConfig,
}

impl Models<'_> {
    /// Saves the states of all instances before a tick. Not real-time.
    pub(super) fn save(self, tick: u64) -> Result<ReplayState, ReplayError> {
        let Self { forces, reports, config } = self;
        let save = |(model, state): (usize, Option<InstanceState<'_>>)| {
            let report = report(reports, model)?;
            let mut state = state.ok_or_else(|| unsaved(report))?;
            let count = state.count().and_then(|count| usize::try_from(count).ok());
            let mut bytes = vec![0; count.ok_or_else(|| rejected(report))?];
            match state.save(&mut bytes) {
                CallStatus::Ok => Ok(Snapshot::new(origin(report, config), bytes)),
                _ => Err(rejected(report)),
            }
        };
        Ok(ReplayState {
            tick,
            instances: forces.states(tick).map(save).collect::<Result<_, ReplayError>>()?,
        })
    }

    /// Restores the states of all instances. Not real-time.
    pub(super) fn restore(self, start: &ReplayState) -> Result<(), ReplayError> {
        let Self { forces, reports, config } = self;
        let mut instances = start.instances.iter();
        for (model, state) in forces.states(start.tick) {
            let report = report(reports, model)?;
            let snapshot = instances.next().ok_or(ReplayError::OtherInstances)?;
            let bytes = snapshot.bytes_for(&origin(report, config))?;
            let mut state = state.ok_or_else(|| unsaved(report))?;
            if state.restore(bytes) != CallStatus::Ok {
                return Err(rejected(report));
            }
        }
        if instances.next().is_some() { Err(ReplayError::OtherInstances) } else { Ok(()) }
    }
}

fn report(reports: &[PluginReport], model: usize) -> Result<&PluginReport, ReplayError> {
    reports.get(model).ok_or(ReplayError::OtherInstances)
}

fn origin(report: &PluginReport, config: &LoopConfig) -> SnapshotOrigin {
    let PluginReport { metadata, parameters, .. } = report;
    SnapshotOrigin::new(&metadata.id, &metadata.version, config, parameters.clone())
}

fn unsaved(report: &PluginReport) -> ReplayError {
    ReplayError::Unsaved { model: report.name.clone() }
}

fn rejected(report: &PluginReport) -> ReplayError {
    SnapshotError::Rejected { id: report.metadata.id.clone() }.into()
}
