//! The thread that keeps one message in flight, and what it shares with the tick.
//!
//! A tick leaves its force and takes the newest sample; neither waits. A force that was not sent yet is replaced by the
//! next one: a queue of commands would be a queue of old forces.

use crate::message::Sample;
use crate::session::Session;
use crate::trouble::Trouble;
use flotor_force_switch::ForceSwitch;
use flotor_hal::DVec3;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often a thread without a command looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(20);

/// What the tick and the thread leave for each other.
#[derive(Debug, Default)]
struct Slots {
    /// The newest force that was not sent yet, N.
    force_n: Option<DVec3>,
    /// The newest sample that was not read yet.
    sample: Option<Sample>,
    /// Why there will be no more.
    trouble: Option<Trouble>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Each side holds it to copy a few numbers, and the tick's side never waits for it.
    slots: Mutex<Slots>,
    is_over: AtomicBool,
}

/// A session in a thread of its own.
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

    /// The newest sample since the last call. Real-time: bounded, no allocation, waits for nothing.
    pub(crate) fn take(&self) -> Result<Option<Sample>, Trouble> {
        match self.shared.slots.try_lock() {
            Ok(mut slots) => slots.trouble.map_or(Ok(slots.sample.take()), Err),
            // The thread is leaving one.
            Err(_) => Ok(None),
        }
    }

    /// Leaves a force for the thread; whether it could. Real-time: bounded, no allocation, waits for nothing.
    pub(crate) fn leave(&self, force_n: DVec3) -> bool {
        let Ok(mut slots) = self.shared.slots.try_lock() else { return false };
        slots.force_n = Some(force_n);
        drop(slots);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
        true
    }

    /// Takes the force away and ends the thread; the session, if it is still good. Waits for the message in flight.
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
            // A stopped device still says where it is.
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
            Err(trouble) => {
                // Before anybody is told: the force is gone when they hear of it.
                session.end();
                lock().trouble = Some(trouble);
                return None;
            }
        }
    }
}
