//! Reader thread that waits for the port, so that the loop never waits.

use crate::frame::{Decoder, POSITION};
use serialport::TTYPort;
use std::io::{self, ErrorKind, Read};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Shift of the number in the word of the newest sample: 48 bits of number, 16 of position. One word is read and written atomically.
const NUMBER_SHIFT: u32 = 16;

/// State of the reader.
#[derive(Debug, PartialEq, Eq)]
pub enum Newest {
    /// Newest sample; number 0 before the first sample.
    Sample { number: u64, position_um: i16 },
    /// The board is disconnected.
    Lost,
}

#[derive(Default)]
struct Shared {
    newest: AtomicU64,
    is_lost: AtomicBool,
    is_ending: AtomicBool,
    /// Mutex of the condition variable, held only for a check.
    waiting: Mutex<()>,
    arrived: Condvar,
}

impl Shared {
    fn tell(&self) {
        drop(self.waiting.lock());
        self.arrived.notify_all();
    }
}

/// Reader thread with its newest sample. Dropping it ends the thread.
pub struct Reader {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Reader {
    /// Starts a thread that reads a port. Not real-time.
    pub fn start(port: TTYPort) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("knob-reader".to_owned());
        let thread = thread.spawn(move || listen(port, &of_thread))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Returns the newest sample. Real-time: bounded, no allocation, no lock.
    pub fn newest(&self) -> Newest {
        if self.shared.is_lost.load(Ordering::Acquire) {
            return Newest::Lost;
        }
        let word = self.shared.newest.load(Ordering::Acquire);
        Newest::Sample { number: word >> NUMBER_SHIFT, position_um: (word & 0xffff) as u16 as i16 }
    }

    /// Waits for a sample after this number, and returns the number of the newest; `None` after the timeout or a loss of the board.
    pub fn wait_beyond(&self, number: u64, timeout: Duration) -> Option<u64> {
        let is_nothing_new =
            || matches!(self.newest(), Newest::Sample { number: newest, .. } if newest == number);
        let guard = self.shared.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.shared.arrived.wait_timeout_while(guard, timeout, |()| is_nothing_new());
        drop(waited);
        match self.newest() {
            Newest::Sample { number: newest, .. } if newest > number => Some(newest),
            _ => None,
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.shared.is_ending.store(true, Ordering::Release);
        // The thread checks `is_ending` after each read, and a read waits no longer than the port's timeout.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn listen(mut port: TTYPort, shared: &Shared) {
    let (mut bytes, mut decoder, mut number) = ([0; 64], Decoder::new(POSITION), 0);
    while !shared.is_ending.load(Ordering::Acquire) {
        let count = match port.read(&mut bytes) {
            Ok(count) if count > 0 => count,
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => continue,
            _ => {
                shared.is_lost.store(true, Ordering::Release);
                return shared.tell();
            }
        };
        for position_um in bytes[..count].iter().filter_map(|byte| decoder.push(*byte)) {
            number += 1;
            let word = number << NUMBER_SHIFT | u64::from(position_um as u16);
            shared.newest.store(word, Ordering::Release);
        }
        shared.tell();
    }
}
