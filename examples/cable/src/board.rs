//! Simulated board: the other end of a pseudo terminal, which the device opens as an ordinary port.

use crate::TIMEOUT;
use crate::frame::{Decoder, FORCE, POSITION, encode};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Simulated board at a constant position. Dropping it disconnects the cable.
pub struct Board {
    force_mn: Arc<AtomicI64>,
    is_ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Board {
    /// Starts the board and returns it with the port for the device.
    pub fn start(position_um: i16) -> (Self, TTYPort) {
        let (mut ours, mut theirs) = TTYPort::pair().expect("the system has pseudo terminals");
        theirs.set_timeout(TIMEOUT).expect("a timeout");
        ours.set_timeout(Duration::from_millis(1)).expect("a timeout");
        let (force_mn, is_ending) = (Arc::new(AtomicI64::new(i64::MIN)), Arc::new(AtomicBool::new(false)));
        let (received, ending) = (Arc::clone(&force_mn), Arc::clone(&is_ending));
        let thread = std::thread::spawn(move || {
            let (mut decoder, mut bytes) = (Decoder::new(FORCE), [0; 64]);
            while !ending.load(Ordering::Acquire) {
                let _ = ours.write_all(&encode(POSITION, position_um));
                // A read without data times out after a millisecond: the period of the board.
                let count = ours.read(&mut bytes).unwrap_or(0);
                for force in bytes[..count].iter().filter_map(|byte| decoder.push(*byte)) {
                    received.store(force.into(), Ordering::Release);
                }
            }
        });
        (Self { force_mn, is_ending, thread: Some(thread) }, theirs)
    }

    /// Waits until the last received force equals `force_mn`; panics after ten seconds.
    pub fn wait_for_force_mn(&self, force_mn: i64) {
        let started = Instant::now();
        while self.force_mn.load(Ordering::Acquire) != force_mn {
            assert!(
                started.elapsed() < Duration::from_secs(10),
                "{} mN",
                self.force_mn.load(Ordering::Acquire)
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.is_ending.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
