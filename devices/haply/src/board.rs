//! A board behind a serial port: one request on its way at a time, nothing waits.
//!
//! An answer that does not come is not waited for: after [`FORGET`] what came of it is forgotten and the next request
//! goes out, which also finds the beginning of an answer again when a byte was lost.

use crate::protocol::{Answers, Arm, Heard, RESET, setup, torques};
use flotor_serial::Port;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// The port is a USB CDC port, to which the number means nothing; a board on a real UART would need it: 20 bytes a
/// millisecond are 200 kbit/s with start and stop bits.
const BAUD: u32 = 250_000;
/// Time without an answer after which a request is given up: a few times what the slowest board takes (4 ms at
/// 57 600 baud).
pub const FORGET: Duration = Duration::from_millis(20);
/// Bytes taken from the system at once: a few answers.
const CHUNK_BYTES: usize = 64;

/// The board is gone: unplugged, or its port is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkLost;

/// No answer came in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoAnswer {
    /// The board is gone.
    Lost,
    /// Something else is at this port, or the board is off.
    Silent,
}

impl From<LinkLost> for NoAnswer {
    fn from(_: LinkLost) -> Self {
        Self::Lost
    }
}

/// A board behind a serial port.
#[derive(Debug)]
pub struct Board {
    port: Port,
    answers: Answers,
    /// When the request that is on its way was sent.
    asked: Option<Instant>,
    /// When the first request without an answer was sent.
    silent_since: Option<Instant>,
    lost_answers: u64,
    noise_bytes: u64,
}

impl Board {
    /// Opens a port by its path. Not real-time.
    ///
    /// # Errors
    /// One sentence: why not, and what to do.
    pub fn open(path: &str) -> Result<Self, String> {
        let port =
            Port::open(path, BAUD).map_err(|reason| format!("no board at {path}, the `port`: {reason}"))?;
        Ok(Self::on(port))
    }

    /// A board behind a port that is open.
    fn on(port: Port) -> Self {
        Self {
            port,
            answers: Answers::default(),
            asked: None,
            silent_since: None,
            lost_answers: 0,
            noise_bytes: 0,
        }
    }

    /// The same port once more, for another thread. Not real-time.
    ///
    /// # Errors
    /// What the system says.
    pub fn second_port(&self) -> io::Result<Port> {
        self.port.second()
    }

    /// Tells the board about its arms, without force, and waits for its first answer: angles, °. Not real-time.
    ///
    /// # Errors
    /// [`NoAnswer`] after `patience`.
    pub fn start(&mut self, arms: &[Arm; 2], patience: Duration) -> Result<[f64; 2], NoAnswer> {
        let started = Instant::now();
        let _ = self.port.forget_input();
        self.answers.clear();
        self.asked = None;
        self.send(&RESET)?;
        self.send(&setup(arms))?;
        loop {
            self.ask([0.0; 2])?;
            if let Some(angles_deg) = self.hear()? {
                return Ok(angles_deg);
            }
            if started.elapsed() > patience {
                return Err(NoAnswer::Silent);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Asks for torques of the arms, N·m, unless the last request is still on its way: then this one is dropped, as a
    /// newer one will follow. Real-time: bounded, no allocation; one or two calls of the system.
    ///
    /// # Errors
    /// [`LinkLost`].
    pub fn ask(&mut self, torques_nm: [f64; 2]) -> Result<(), LinkLost> {
        if let Some(asked) = self.asked {
            if asked.elapsed() < FORGET {
                return Ok(());
            }
            self.lost_answers += 1;
            self.answers.clear();
            self.port.forget_input().map_err(|_| LinkLost)?;
        }
        #[allow(clippy::cast_possible_truncation)] // f32 is what the board has
        self.send(&torques(torques_nm.map(|torque_nm| torque_nm as f32)))?;
        let now = Instant::now();
        self.asked = Some(now);
        self.silent_since.get_or_insert(now);
        Ok(())
    }

    /// The newest answer that has arrived: angles of the arms, °. Real-time: bounded, no allocation; two calls of the
    /// system.
    ///
    /// # Errors
    /// [`LinkLost`].
    pub fn hear(&mut self) -> Result<Option<[f64; 2]>, LinkLost> {
        let mut newest = None;
        // Asked beforehand: a read without anything to read would make an error, and an error is an allocation; and a system may wait
        // for more than there is.
        let waiting = self.port.waiting().map_err(|_| LinkLost)?;
        if waiting == 0 {
            return Ok(None);
        }
        let mut chunk = [0; CHUNK_BYTES];
        let room = CHUNK_BYTES.min(waiting);
        let length = self.port.read(chunk.get_mut(..room).unwrap_or_default()).map_err(|_| LinkLost)?;
        for byte in chunk.iter().take(length) {
            match self.answers.push(*byte) {
                Heard::Angles(angles_deg) => newest = Some(angles_deg),
                Heard::Noise => self.noise_bytes += 1,
                Heard::Part => {}
            }
        }
        if newest.is_some() {
            (self.asked, self.silent_since) = (None, None);
        }
        Ok(newest)
    }

    /// How long the board has not answered. Real-time: bounded, no allocation.
    #[must_use]
    pub fn silence(&self) -> Duration {
        self.silent_since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Requests without an answer, and bytes that belonged to none.
    #[must_use]
    pub fn losses(&self) -> (u64, u64) {
        (self.lost_answers, self.noise_bytes)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkLost> {
        match self.port.write_all(bytes) {
            Ok(()) => Ok(()),
            // The port is full: the request is lost, and its answer will be missed.
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {
                Ok(())
            }
            Err(_) => Err(LinkLost),
        }
    }
}
