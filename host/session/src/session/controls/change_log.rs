//! Log of changes that the loop reports, for the observer of a run.

use super::super::observer::Observer;
use super::plugin_table::PluginTable;
use flotor_core::trace::TickRecord;
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

    /// Passes all changes up to a record's tick to an observer, then the record. Not real-time.
    pub(in super::super) fn deliver(&mut self, record: &TickRecord, observer: &mut dyn Observer) {
        self.changes_up_to(record.tick, observer);
        observer.observe(record);
    }

    fn changes_up_to(&mut self, tick: u64, observer: &mut dyn Observer) {
        while let Some(report) = self.pending.take().or_else(|| self.reports.pop().ok()) {
            if report.tick > tick {
                self.pending = Some(report);
                return;
            }
            if report.change.parameter == PLUGIN {
                self.plugins.set_current(report.change.plugin, report.change.generation);
            }
            observer.change(&self.plugins.describe(&report));
        }
    }
}
