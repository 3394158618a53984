//! Board behind a serial port, with one request in flight and no waits.
//!
//! A missing reply does not block: after [`REPLY_TIMEOUT`] the request and the partial reply are dropped and the next request is sent,
//! which also resynchronises after a lost byte.

use crate::protocol::{Answers, Arm, Parsed, RESET, setup, torques};
use flotor_serial::Port;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Baud rate. A USB CDC port ignores it; a board on a real UART needs it: 20 bytes a millisecond are 200 kbit/s with start and
/// stop bits.
const BAUD: u32 = 250_000;
/// Reply timeout: a few times the reply time of the slowest board (4 ms at 57 600 baud).
pub const REPLY_TIMEOUT: Duration = Duration::from_millis(20);
/// Buffer size of one read, bytes: a few replies.
const CHUNK_BYTES: usize = 64;

/// Error: the board is gone (unplugged, or its port is closed).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkLost;

/// Error of the first request to a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoAnswer {
    /// The board is gone.
    Lost,
    /// Timeout: another device is at this port, or the board is off.
    Silent,
}

impl From<LinkLost> for NoAnswer {
    fn from(_: LinkLost) -> Self {
        Self::Lost
    }
}

/// Connection to a board behind a serial port.
#[derive(Debug)]
pub struct Board {
    port: Port,
    answers: Answers,
    /// Time of the pending request.
    requested_at: Option<Instant>,
    /// Time of the first request without a reply.
    silent_since: Option<Instant>,
    lost_answers: u64,
    noise_bytes: u64,
}

impl Board {
    /// Opens a port by its path. Not real-time.
    ///
    /// # Errors
    /// One sentence with the cause and the remedy.
    pub fn open(path: &str) -> Result<Self, String> {
        let port = Port::open(path, BAUD)
            .map_err(|reason| format!("cannot open the board at {path} (`port`): {reason}"))?;
        Ok(Self::on(port))
    }

    /// Wraps an open port.
    fn on(port: Port) -> Self {
        Self {
            port,
            answers: Answers::default(),
            requested_at: None,
            silent_since: None,
            lost_answers: 0,
            noise_bytes: 0,
        }
    }

    /// Returns a second handle of the port, for another thread. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn second_port(&self) -> io::Result<Port> {
        self.port.second()
    }

    /// Resets the board, configures the arms, requests zero torque and waits for the first reply; returns the angles of
    /// the arms, °. Not real-time.
    ///
    /// # Errors
    /// [`NoAnswer::Silent`] after `patience`, or [`NoAnswer::Lost`] if the board is gone.
    pub fn start(&mut self, arms: &[Arm; 2], patience: Duration) -> Result<[f64; 2], NoAnswer> {
        let started = Instant::now();
        let _ = self.port.discard_input();
        self.answers.clear();
        self.requested_at = None;
        self.send(&RESET)?;
        self.send(&setup(arms))?;
        loop {
            self.request([0.0; 2])?;
            if let Some(angles_deg) = self.poll()? {
                return Ok(angles_deg);
            }
            if started.elapsed() > patience {
                return Err(NoAnswer::Silent);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Requests torques of the arms, N·m, and a reply with the angles; drops the request while the previous request is pending,
    /// because a newer request will follow. Real-time: bounded, no allocation; one or two system calls.
    ///
    /// # Errors
    /// If the board is gone.
    pub fn request(&mut self, torques_nm: [f64; 2]) -> Result<(), LinkLost> {
        if let Some(requested_at) = self.requested_at {
            if requested_at.elapsed() < REPLY_TIMEOUT {
                return Ok(());
            }
            self.lost_answers += 1;
            self.answers.clear();
            self.port.discard_input().map_err(|_| LinkLost)?;
        }
        #[allow(clippy::cast_possible_truncation)] // f32 is what the board has
        self.send(&torques(torques_nm.map(|torque_nm| torque_nm as f32)))?;
        let now = Instant::now();
        self.requested_at = Some(now);
        self.silent_since.get_or_insert(now);
        Ok(())
    }

    /// Returns the angles of the arms, °, of the newest received reply; `None` if no reply was completed. Real-time: bounded, no
    /// allocation; two system calls.
    ///
    /// # Errors
    /// If the board is gone.
    pub fn poll(&mut self) -> Result<Option<[f64; 2]>, LinkLost> {
        let mut newest = None;
        // Query the count first: a read without data would return an error, which allocates; and a system may wait for more bytes than
        // there are.
        let waiting = self.port.waiting().map_err(|_| LinkLost)?;
        if waiting == 0 {
            return Ok(None);
        }
        let mut chunk = [0; CHUNK_BYTES];
        let room = CHUNK_BYTES.min(waiting);
        let length = self.port.read(chunk.get_mut(..room).unwrap_or_default()).map_err(|_| LinkLost)?;
        for byte in chunk.iter().take(length) {
            match self.answers.push(*byte) {
                Parsed::Angles(angles_deg) => newest = Some(angles_deg),
                Parsed::Noise => self.noise_bytes += 1,
                Parsed::Part => {}
            }
        }
        if newest.is_some() {
            (self.requested_at, self.silent_since) = (None, None);
        }
        Ok(newest)
    }

    /// Returns the time since the first unanswered request; zero without one. Real-time: bounded, no allocation.
    #[must_use]
    pub fn silence(&self) -> Duration {
        self.silent_since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Returns the number of requests without a reply, and the number of received bytes that belong to no reply.
    #[must_use]
    pub fn losses(&self) -> (u64, u64) {
        (self.lost_answers, self.noise_bytes)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkLost> {
        match self.port.write_all(bytes) {
            Ok(()) => Ok(()),
            // The port is full: the request is lost, and its reply will time out.
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {
                Ok(())
            }
            Err(_) => Err(LinkLost),
        }
    }
}
