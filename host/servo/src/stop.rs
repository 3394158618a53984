//! Stop switch: orderly end or emergency stop of a run, from any thread of the process.

use super::platform::clock;
use flotor_core::run_state::EmergencySource;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// Switch that ends a run from any thread, or through its flags from a signal handler. Clones share their state.
///
/// A request to stop cannot be taken back.
#[derive(Clone, Debug, Default)]
pub struct StopSwitch {
    in_order: Arc<AtomicBool>,
    by_signal: Arc<AtomicBool>,
    /// First source of an emergency stop, except the flag of a signal handler: index in [`EmergencySource::ALL`] plus one; 0: none.
    pressed: Arc<AtomicU32>,
    /// Time of the first press on the monotonic clock, ns; 0: none.
    pressed_ns: Arc<AtomicU64>,
}

impl StopSwitch {
    /// Requests an orderly end: force fades out, files are closed. Real-time: bounded, no allocation.
    pub fn stop(&self) {
        self.in_order.store(true, Ordering::Relaxed);
    }

    /// Triggers the emergency stop and wakes the threads that wait for the stop. Only the first source is stored. Real-time: one
    /// system call, after the last tick.
    pub fn press(&self, source: EmergencySource) {
        let place = EmergencySource::ALL.iter().position(|other| *other == source);
        let code = place.and_then(|place| u32::try_from(place + 1).ok()).unwrap_or(1);
        if self.pressed_ns.load(Ordering::Relaxed) == 0 {
            self.pressed_ns.store(clock::monotonic_ns(), Ordering::Relaxed);
        }
        let _ = self.pressed.compare_exchange(0, code, Ordering::Relaxed, Ordering::Relaxed);
        clock::wake_all(&self.pressed);
    }

    /// Sleeps until [`StopSwitch::press`], or until the timeout; may return earlier. The flag of a signal handler does not end the
    /// sleep: the run has to press the switch when it reads the flag. Not real-time.
    pub fn sleep_until_pressed(&self, timeout: Duration) {
        clock::sleep_while_zero(&self.pressed, timeout);
    }

    /// Returns true if an orderly end is requested. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_stop_requested(&self) -> bool {
        self.in_order.load(Ordering::Relaxed)
    }

    /// Returns the source of the emergency stop; `None` without an emergency stop. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn emergency(&self) -> Option<EmergencySource> {
        let place = (self.pressed.load(Ordering::Relaxed) as usize).checked_sub(1);
        let by_signal = || self.by_signal.load(Ordering::Relaxed).then_some(EmergencySource::Signal);
        place.and_then(|place| EmergencySource::ALL.get(place).copied()).or_else(by_signal)
    }

    /// Returns the time of the first [`StopSwitch::press`] on the monotonic clock, ns; `None` if there was none. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn pressed_ns(&self) -> Option<u64> {
        Some(self.pressed_ns.load(Ordering::Relaxed)).filter(|pressed_ns| *pressed_ns > 0)
    }

    /// Returns the flag that a signal handler sets for an orderly end.
    #[must_use]
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.in_order)
    }

    /// Returns the flag that a signal handler sets for an emergency stop.
    #[must_use]
    pub fn emergency_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.by_signal)
    }
}
