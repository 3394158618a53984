//! How the rest of the process ends a run: in order, or at once.

use super::state::EmergencySource;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Ends a run from any thread or signal handler. Clones are the same switch.
///
/// It only ever closes: what has been asked for cannot be taken back.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    in_order: Arc<AtomicBool>,
    by_key: Arc<AtomicBool>,
    by_signal: Arc<AtomicBool>,
    by_watcher: Arc<AtomicBool>,
    by_latch: Arc<AtomicBool>,
}

impl StopSwitch {
    /// Asks for an orderly end: force fades out, files are closed. Real-time: bounded, no allocation.
    pub fn stop(&self) {
        self.in_order.store(true, Ordering::Relaxed);
    }

    /// The emergency stop of the keyboard. Real-time: bounded, no allocation.
    pub fn emergency_by_key(&self) {
        self.by_key.store(true, Ordering::Relaxed);
    }

    /// The emergency stop of a program that watches the run. Real-time: bounded, no allocation.
    pub fn emergency_by_watcher(&self) {
        self.by_watcher.store(true, Ordering::Relaxed);
    }

    /// The emergency stop of this machine, pressed elsewhere. Real-time: bounded, no allocation.
    pub fn emergency_by_latch(&self) {
        self.by_latch.store(true, Ordering::Relaxed);
    }

    /// True if an orderly end is asked for. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_stop_asked(&self) -> bool {
        self.in_order.load(Ordering::Relaxed)
    }

    /// Who has pressed the emergency stop, if anybody. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn emergency(&self) -> Option<EmergencySource> {
        if self.by_key.load(Ordering::Relaxed) {
            return Some(EmergencySource::Key);
        }
        if self.by_watcher.load(Ordering::Relaxed) {
            return Some(EmergencySource::Watcher);
        }
        if self.by_signal.load(Ordering::Relaxed) {
            return Some(EmergencySource::Signal);
        }
        self.by_latch.load(Ordering::Relaxed).then_some(EmergencySource::Latch)
    }

    /// The flag a signal handler sets for an orderly end.
    #[must_use]
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.in_order)
    }

    /// The flag a signal handler sets for an emergency stop.
    #[must_use]
    pub fn emergency_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.by_signal)
    }
}
