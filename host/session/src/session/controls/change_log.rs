//! Changes that the loop reports, passed to the observer of a run.

use super::super::observer::Observer;
use super::plugin_table::PluginTable;
use flotor_core::trace::TickRecord;
use flotor_servo::{ChangeReport, PLUGIN, ReportReceiver};

/// Receiver of the loop's change reports: passes each change to the observer before the record of its tick.
pub(in super::super) struct ChangeLog {
    plugins: PluginTable,
    reports: ReportReceiver,
    /// Next report, if its tick is later than the last record.
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
            if observer.reads_changes() {
                observer.change(&self.plugins.describe(&report));
            }
        }
    }
}
