//! Stop by a Land frame, on a connection of its own. Zero force is not a safe state while levitating: the flotor would fall.

use super::connection::Line;
use crate::ml_api::{Frame, Function, Request};
use crate::platform;
use crate::transport::OpenError;
use flotor_hal::{IndependentStop, SafeStop, StoppedState};
use std::io::{Read, Write};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex};

/// Longest duration of a landing, ns.
const LANDING_NS: u64 = 30_000_000_000;

/// States of a stop: none since arming, one whose Land frame is due, and one whose frame was sent.
const ARMED: u8 = 0;
const DUE: u8 = 1;
const SENT: u8 = 2;

/// State shared by the loop and the stopping threads.
pub(crate) struct Stop {
    /// [`ARMED`], [`DUE`] or [`SENT`].
    state: AtomicU8,
    /// A stop does not wait for the lock: the thread that holds the lock sends the due frame after unlocking.
    line: Mutex<Line>,
    frame: Frame,
}

impl Stop {
    /// Opens the connection. Not real-time.
    pub(crate) fn open(address: &str) -> Result<Self, OpenError> {
        let frame = Request::Plain(Function::Land).encode();
        Ok(Self { state: AtomicU8::new(ARMED), line: Mutex::new(Line::open(address)?), frame })
    }

    /// Returns true after a stop. Real-time: bounded, no allocation.
    pub(crate) fn is_stopped(&self) -> bool {
        self.state.load(Ordering::SeqCst) != ARMED
    }

    /// Clears earlier stops and discards the replies to them; a stop from now on lands the flotor. Not real-time.
    pub(crate) fn rearm(&self) {
        self.state.store(ARMED, Ordering::SeqCst);
        if let Ok(mut line) = self.line.lock() {
            let mut replies = [0; 64];
            while line.stream.read(&mut replies).is_ok_and(|length| length > 0) {}
        }
        self.send_due_frame();
    }

    /// Reconnects to the controller, and repeats a stop since the last `rearm`. Not real-time.
    pub(crate) fn reopen(&self, address: &str) -> Result<(), OpenError> {
        let anew = Line::open(address)?;
        if let Ok(mut line) = self.line.lock() {
            *line = anew;
        }
        self.change(SENT, DUE);
        self.send_due_frame();
        Ok(())
    }

    /// Sends the Land frame once, without waiting for a reply.
    fn stop(&self) {
        self.change(ARMED, DUE);
        self.send_due_frame();
    }

    /// Sends the Land frame if it is due, unless another thread holds the connection and will send it.
    fn send_due_frame(&self) {
        // Checked again after unlocking: meanwhile another thread may have found the lock taken.
        while self.state.load(Ordering::SeqCst) == DUE {
            let Ok(mut line) = self.line.try_lock() else { return };
            if self.change(DUE, SENT) {
                let _ = line.stream.write(self.frame.bytes());
            }
        }
    }

    /// Changes one state to another; returns false in any other state.
    fn change(&self, from: u8, to: u8) -> bool {
        self.state.compare_exchange(from, to, Ordering::SeqCst, Ordering::SeqCst).is_ok()
    }

    /// Declares the independent stop of the device: the Land frame on this connection.
    pub(crate) fn independent(&self) -> IndependentStop {
        let descriptor = self.line.lock().map_or(-1, |line| platform::descriptor(&line.stream));
        IndependentStop::by_message(descriptor, self.frame.bytes(), StoppedState::Landed, LANDING_NS)
    }
}

/// Stop handle that lands the flotor, usable from any thread.
pub struct LandSwitch(pub(crate) Arc<Stop>);

impl SafeStop for LandSwitch {
    fn safe_stop(&self) {
        self.0.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{TcpListener, TcpStream};

    fn opened() -> (TcpListener, String, Stop, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let stop = Stop::open(&address).expect("a connection");
        let (controller, _) = listener.accept().expect("the connection");
        (listener, address, stop, controller)
    }

    /// Returns the bytes that the controller receives until the connection ends.
    fn received(stop: Stop, mut controller: TcpStream) -> Vec<u8> {
        stop.line.lock().expect("the line").stream.shutdown(std::net::Shutdown::Write).expect("shut down");
        let mut bytes = Vec::new();
        controller.read_to_end(&mut bytes).expect("the frames");
        bytes
    }

    #[test]
    fn a_stop_during_rearming_sends_one_land_frame() {
        let (_listener, _, stop, controller) = opened();
        stop.state.store(SENT, Ordering::SeqCst);
        let frame = stop.frame;
        std::thread::scope(|scope| {
            let line = stop.line.lock().expect("the line");
            let rearming = scope.spawn(|| stop.rearm());
            while stop.is_stopped() {
                std::thread::yield_now();
            }
            stop.stop();
            stop.stop();
            drop(line);
            rearming.join().expect("no panic");
        });
        assert!(stop.is_stopped());
        assert_eq!(received(stop, controller), frame.bytes());
    }

    #[test]
    fn a_stop_on_a_lost_connection_is_repeated_on_the_next() {
        let (listener, address, stop, controller) = opened();
        drop(controller);
        stop.stop();
        let frame = stop.frame;
        stop.reopen(&address).expect("a connection");
        let (controller, _) = listener.accept().expect("the connection");
        assert_eq!(received(stop, controller), frame.bytes());
    }

    #[test]
    fn an_earlier_stop_is_not_repeated_after_rearming() {
        let (listener, address, stop, _controller) = opened();
        stop.stop();
        stop.rearm();
        stop.reopen(&address).expect("a connection");
        let (controller, _) = listener.accept().expect("the connection");
        assert_eq!(received(stop, controller), []);
    }
}
