//! Stop switch for devices whose I/O runs on a thread of the plugin: any thread can remove the force. The switch wakes
//! the I/O thread, which then commands zero force.

use flotor_hal::{SafeStop, StopFlag};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Thread;

/// Stop switch for the force of a device, usable from any thread; clones share the state. [`SafeStop::safe_stop`] stops
/// the force.
#[derive(Clone, Debug, Default)]
pub struct ForceSwitch {
    stop: StopFlag,
    thread: Arc<Mutex<Option<Thread>>>,
}

impl ForceSwitch {
    /// Returns true from a stop until [`Self::rearm`]: the I/O thread must then command zero force. Real-time: bounded,
    /// no allocation.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stop.is_set()
    }

    /// Ends a stop: force is permitted again. Real-time: bounded, no allocation.
    pub fn rearm(&self) {
        self.stop.arm();
    }

    /// Sets the I/O thread that a stop wakes, replacing an earlier one. Not real-time.
    pub fn wakes(&self, thread: Thread) {
        *self.thread.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread);
    }
}

impl SafeStop for ForceSwitch {
    fn safe_stop(&self) {
        self.stop.safe_stop();
        // Never waits: on contention the I/O thread sees the flag at its next poll.
        if let Ok(thread) = self.thread.try_lock()
            && let Some(thread) = &*thread
        {
            thread.unpark();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_wakes_the_thread_and_stays_until_it_is_rearmed() {
        let switch = ForceSwitch::default();
        let waiting = switch.clone();
        let thread = std::thread::spawn(move || {
            while !waiting.is_stopped() {
                // For ever, unless it is woken.
                std::thread::park();
            }
        });
        switch.wakes(thread.thread().clone());
        switch.safe_stop();
        thread.join().expect("it is woken");
        assert!(switch.is_stopped());
        switch.rearm();
        assert!(!switch.is_stopped());
    }
}
