//! Stop by a Land frame, on a connection of its own. Zero force is no safe state while levitating: the flotor would fall.

use super::connection::Line;
use crate::ml_api::{Frame, Function, Request};
use crate::platform;
use crate::transport::OpenError;
use flotor_hal::{IndependentStop, SafeStop, StoppedState};
use std::io::{Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Longest duration of a landing, ns.
const LANDING_NS: u64 = 30_000_000_000;

/// State shared by the loop and the stopping threads.
pub(crate) struct Stop {
    is_stopped: AtomicBool,
    /// Locked while stopping or reopening; a stop does not wait for the lock.
    line: Mutex<Line>,
    frame: Frame,
}

impl Stop {
    /// Opens the connection. Not real-time.
    pub(crate) fn open(address: &str) -> Result<Self, OpenError> {
        let frame = Request::Plain(Function::Land).encode();
        Ok(Self { is_stopped: AtomicBool::new(false), line: Mutex::new(Line::open(address)?), frame })
    }

    /// Returns true after a stop. Real-time: bounded, no allocation.
    pub(crate) fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Acquire)
    }

    /// Clears the stop and discards replies to earlier stops. Not real-time.
    pub(crate) fn rearm(&self) {
        if let Ok(line) = self.line.lock() {
            let mut replies = [0; 64];
            while line.stream().read(&mut replies).is_ok_and(|length| length > 0) {}
        }
        self.is_stopped.store(false, Ordering::Release);
    }

    /// Reconnects to the controller. Not real-time.
    pub(crate) fn reopen(&self, address: &str) -> Result<(), OpenError> {
        let anew = Line::open(address)?;
        if let Ok(mut line) = self.line.lock() {
            *line = anew;
        }
        Ok(())
    }

    /// Sends the Land frame once, without waiting for a reply.
    fn stop(&self) {
        if self.is_stopped.swap(true, Ordering::AcqRel) {
            return;
        }
        if let Ok(line) = self.line.try_lock() {
            let _ = line.stream().write(self.frame.bytes());
        }
    }

    /// Describes the stop of the device without its host.
    pub(crate) fn independent(&self) -> IndependentStop {
        let descriptor = self.line.lock().map_or(-1, |line| platform::descriptor(line.stream()));
        IndependentStop::by_message(descriptor, self.frame.bytes(), StoppedState::Landed, LANDING_NS)
    }
}

/// Lands the flotor, from any thread.
pub struct LandSwitch(pub(crate) Arc<Stop>);

impl SafeStop for LandSwitch {
    fn safe_stop(&self) {
        self.0.stop();
    }
}
