//! The end of the watchdog process itself.

use crate::calls::{Notice, tell};
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{RunEnd, StopSwitch};
use std::sync::{Arc, Weak};

/// Watch over the watchdog process of a run.
pub struct Guardian {
    process: Weak<WatchdogProcess>,
    is_required: bool,
    is_gone: bool,
}

impl Guardian {
    /// Watches over this process, if there is one; `is_required` ends a run that loses it.
    #[must_use]
    pub fn of(process: Option<&Arc<WatchdogProcess>>, is_required: bool) -> Self {
        Self { process: process.map(Arc::downgrade).unwrap_or_default(), is_required, is_gone: false }
    }

    /// Reports the end of the process once; a run that requires it ends in order then. Not real-time.
    pub fn look(&mut self, stop: &StopSwitch) {
        if self.is_gone || !self.process.upgrade().is_some_and(|process| process.is_gone()) {
            return;
        }
        self.is_gone = true;
        if self.is_required {
            stop.stop();
        } else {
            tell(&Notice::Unguarded);
        }
    }

    /// What this means for the end of a run.
    pub(super) fn end(&self, end: RunEnd) -> RunEnd {
        match end {
            RunEnd::Stopped if self.is_required && self.is_gone => RunEnd::Unguarded,
            other => other,
        }
    }

    /// What people should know, and were told.
    pub(super) fn warning(&self) -> Option<String> {
        (self.is_gone && !self.is_required).then(|| Notice::Unguarded.to_string())
    }
}
