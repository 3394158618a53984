//! Loop of a run before its devices are energised.

use super::observer::Taps;
use super::plugin_report::PluginNames;
use super::{PluginReport, RunError};
use crate::calls::{Call, CallThread, Progress, is_to_begin, limit};
use flotor_core::PluginIndex;
use flotor_loader::Stopper;
use flotor_servo::{Servo, Standby};

/// Loop whose devices are open and not energised.
pub(super) struct PreparedLoop {
    pub(super) standby: Standby,
    pub(super) plugins: Vec<PluginReport>,
    pub(super) taps: Taps,
    pub(super) period_ns: u64,
    pub(super) duration_ns: u64,
}

/// Energises the devices of a run right before its first tick, with a time limit for each; stops the devices if a call does not
/// return. Not real-time.
pub(super) fn activate(standby: Standby, plugins: &[PluginReport]) -> Result<Servo, RunError> {
    let (plugins, stoppers) = (plugins.to_vec(), standby.stoppers());
    let activate = move |progress: &Progress| activate_here(standby, &plugins, progress);
    let activated = CallThread::default().run_while(limit(), is_to_begin, activate);
    let activated = activated.inspect_err(|_| stoppers.iter().for_each(Stopper::safe_stop))?;
    activated.inspect(Servo::register_loop_thread)
}

/// Energises the devices in this thread; another thread polls `progress` for a call that does not return. Not real-time.
pub(super) fn activate_here(
    standby: Standby,
    plugins: &[PluginReport],
    progress: &Progress,
) -> Result<Servo, RunError> {
    let names = PluginNames::of(plugins);
    let enters = |device: usize| progress.enter(&names.name(PluginIndex::at(device)), Call::Activate);
    let activated = standby.activate(names.all.clone(), enters);
    progress.exit();
    activated.map_err(|(device, refusal)| match plugins.get(device) {
        Some(report) => RunError::refused(&report.metadata, refusal),
        None => RunError::Thread("names a device that the scene does not have"),
    })
}
