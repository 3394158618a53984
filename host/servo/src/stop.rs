//! How the rest of the process ends a run: in order, or at once.

use super::state::EmergencySource;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Ends a run from any thread or signal handler. Clones are the same switch.
///
/// It only ever closes: what has been asked for cannot be taken back.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    in_order: Arc<AtomicBool>,
    by_signal: Arc<AtomicBool>,
    /// Who else has pressed the emergency stop first: the place in [`EmergencySource::ALL`], from 1; 0: nobody.
    pressed: Arc<AtomicU8>,
}

impl StopSwitch {
    /// Asks for an orderly end: force fades out, files are closed. Real-time: bounded, no allocation.
    pub fn stop(&self) {
        self.in_order.store(true, Ordering::Relaxed);
    }

    /// Presses the emergency stop. Who pressed first stays known. Real-time: bounded, no allocation.
    pub fn press(&self, source: EmergencySource) {
        let place = EmergencySource::ALL.iter().position(|other| *other == source);
        let code = place.and_then(|place| u8::try_from(place + 1).ok()).unwrap_or(1);
        let _ = self.pressed.compare_exchange(0, code, Ordering::Relaxed, Ordering::Relaxed);
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
        let place = usize::from(self.pressed.load(Ordering::Relaxed)).checked_sub(1);
        let by_signal = || self.by_signal.load(Ordering::Relaxed).then_some(EmergencySource::Signal);
        place.and_then(|place| EmergencySource::ALL.get(place).copied()).or_else(by_signal)
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
