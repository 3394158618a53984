//! Thread that keeps one message in flight, and its data exchange with the tick.
//!
//! A tick posts its force and takes the newest sample; neither waits. A pending force is replaced by the next one: a queue of
//! commands would delay the newest behind old ones.

use crate::message::Sample;
use crate::session::Session;
use crate::session_error::SessionError;
use flotor_force_switch::ForceSwitch;
use flotor_hal::DVec3;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Poll interval for the end of the exchange while no command is pending.
const LOOK: Duration = Duration::from_millis(20);

/// Data exchanged between tick and thread.
#[derive(Debug, Default)]
struct Slots {
    /// Newest force, not sent yet, N.
    force_n: Option<DVec3>,
    /// Newest sample, not read yet.
    sample: Option<Sample>,
    /// Fault that ended the exchange.
    error: Option<SessionError>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Locked only to copy a few numbers; the tick never waits for the lock.
    slots: Mutex<Slots>,
    is_over: AtomicBool,
}

/// Session that runs in its own thread.
#[derive(Debug)]
pub(crate) struct Exchange {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Option<Session>>>,
}

impl Exchange {
    /// Starts the thread. Not real-time.
    pub(crate) fn start(session: Session, switch: &ForceSwitch) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let (theirs, stop) = (Arc::clone(&shared), switch.clone());
        let thread = std::thread::Builder::new().name("flotor-inverse3".to_owned());
        let thread = thread.spawn(move || run(session, &theirs, &stop))?;
        switch.wakes(thread.thread().clone());
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Returns the newest sample since the last call; `None` if no sample has arrived, or the lock is contended. Real-time:
    /// bounded, no allocation, no wait.
    ///
    /// # Errors
    /// The fault that ended the exchange.
    pub(crate) fn take(&self) -> Result<Option<Sample>, SessionError> {
        match self.shared.slots.try_lock() {
            Ok(mut slots) => slots.error.map_or(Ok(slots.sample.take()), Err),
            // Contention: the thread is storing a sample.
            Err(_) => Ok(None),
        }
    }

    /// Posts a force for the thread; returns false if the lock is contended. Real-time: bounded, no allocation, no wait.
    pub(crate) fn post(&self, force_n: DVec3) -> bool {
        let Ok(mut slots) = self.shared.slots.try_lock() else { return false };
        slots.force_n = Some(force_n);
        drop(slots);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
        true
    }

    /// Removes the force and ends the thread; returns the session unless it has failed. Waits for the message in flight.
    pub(crate) fn end(&mut self) -> Option<Session> {
        self.shared.is_over.store(true, Ordering::Release);
        let thread = self.thread.take()?;
        thread.thread().unpark();
        thread.join().ok().flatten()
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        drop(self.end());
    }
}

fn run(mut session: Session, shared: &Shared, switch: &ForceSwitch) -> Option<Session> {
    let lock = || shared.slots.lock().unwrap_or_else(PoisonError::into_inner);
    let mut last_n = DVec3::ZERO;
    loop {
        let is_over = shared.is_over.load(Ordering::Acquire);
        let left = lock().force_n.take();
        let force_n = match (left, is_over || switch.is_stopped()) {
            (_, true) if last_n != DVec3::ZERO => DVec3::ZERO,
            _ if is_over => return Some(session),
            // A stopped device still returns samples.
            (Some(_), true) => DVec3::ZERO,
            (Some(force_n), false) => force_n,
            (None, _) => {
                std::thread::park_timeout(LOOK);
                continue;
            }
        };
        last_n = force_n;
        match session.exchange(force_n) {
            Ok(sample) => lock().sample = Some(sample),
            Err(error) => {
                // End first: the force is gone when the host receives the fault.
                session.end();
                lock().error = Some(error);
                return None;
            }
        }
    }
}
