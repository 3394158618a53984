//! Monitor for the end of the watchdog process itself.

use crate::calls::{Notice, notify};
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{RunEnd, StopSwitch};
use std::sync::{Arc, Weak};

/// Monitor of the watchdog process of a run.
pub struct Guardian {
    process: Weak<WatchdogProcess>,
    is_required: bool,
    is_gone: bool,
}

impl Guardian {
    /// Monitors this process, if there is one; with `is_required` its loss ends the run.
    #[must_use]
    pub fn of(process: Option<&Arc<WatchdogProcess>>, is_required: bool) -> Self {
        Self { process: process.map(Arc::downgrade).unwrap_or_default(), is_required, is_gone: false }
    }

    /// Reports the end of the process once; a run that requires the process ends in order then. Not real-time.
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

    /// Returns the end of the run, `Unguarded` if it was stopped for the loss of a required process.
    pub(super) fn end(&self, end: RunEnd) -> RunEnd {
        match end {
            RunEnd::Stopped if self.is_required && self.is_gone => RunEnd::Unguarded,
            other => other,
        }
    }

    /// Returns the warning for users, which was shown already.
    pub(super) fn warning(&self) -> Option<String> {
        (self.is_gone && !self.is_required).then(|| Notice::Unguarded.to_string())
    }
}
