//! Log of changes that the loop reports, for the observer of a run.

use super::plugin_table::PluginTable;
use flotor_core::Change;
use flotor_servo::{ChangeReport, PLUGIN, ReportReceiver};

/// Changes of a run for its observer, each before its tick.
pub(in super::super) struct ChangeLog {
    plugins: PluginTable,
    reports: ReportReceiver,
    /// The next change, of a later tick.
    pending: Option<ChangeReport>,
}

impl ChangeLog {
    pub(in super::super) fn new(plugins: PluginTable, reports: ReportReceiver) -> Self {
        Self { plugins, reports, pending: None }
    }

    /// Passes all changes up to a tick to `observe`. Not real-time.
    pub(in super::super) fn up_to(&mut self, tick: u64, mut observe: impl FnMut(&Change)) {
        while let Some(report) = self.pending.take().or_else(|| self.reports.pop().ok()) {
            if report.tick > tick {
                self.pending = Some(report);
                return;
            }
            if report.change.parameter == PLUGIN {
                self.plugins.set_current(report.change.plugin, report.change.generation);
            }
            observe(&self.plugins.describe(&report));
        }
    }
}
