//! Monitor that detects the end of the watchdog process during a run.

use crate::calls::{Notice, notify};
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{RunEnd, StopSwitch};
use std::sync::{Arc, Weak};

/// Monitor of a run's watchdog process: stops the run or warns if the process ends.
pub struct Guardian {
    process: Weak<WatchdogProcess>,
    is_required: bool,
    is_gone: bool,
}

impl Guardian {
    /// Creates a monitor of a watchdog process, without effect for `None`; with `is_required` the end of the process stops the run.
    #[must_use]
    pub fn of(process: Option<&Arc<WatchdogProcess>>, is_required: bool) -> Self {
        Self { process: process.map(Arc::downgrade).unwrap_or_default(), is_required, is_gone: false }
    }

    /// Checks whether the process has ended, and reacts once: requests `stop` if the run requires the process, otherwise notifies the
    /// user. Not real-time.
    pub fn check(&mut self, stop: &StopSwitch) {
        if self.is_gone || !self.process.upgrade().is_some_and(|process| process.is_gone()) {
            return;
        }
        self.is_gone = true;
        if self.is_required {
            stop.stop();
        } else {
            notify(&Notice::Unguarded);
        }
    }

    /// Converts the end of the run: `Unguarded` if the end of a required process stopped it, unchanged otherwise.
    pub(super) fn end(&self, end: RunEnd) -> RunEnd {
        match end {
            RunEnd::Stopped if self.is_required && self.is_gone => RunEnd::Unguarded,
            other => other,
        }
    }

    /// Returns the warning that the watchdog process has ended, which the user has seen as a notice; `None` if the process still
    /// runs or is required.
    pub(super) fn warning(&self) -> Option<String> {
        (self.is_gone && !self.is_required).then(|| Notice::Unguarded.to_string())
    }
}
