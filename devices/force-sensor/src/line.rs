//! Serial line to the sensor with one request in flight.

use crate::protocol::{Lines, QUESTION, parse};
use flotor_serial::Port;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Baud rate: the default of microcontroller boards.
const BAUD: u32 = 115_200;
/// Buffer size of one read, bytes: several replies.
const CHUNK_BYTES: usize = 256;

/// Error: connection to the sensor lost (port closed or sensor unplugged).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineLost;

/// Result of polling the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PollResult {
    /// No complete line yet.
    Nothing,
    /// Measured vertical force, N, upwards positive.
    Force(f64),
    /// Malformed line; [`SensorLine::last`] returns it.
    Malformed,
}

/// Connection to a force sensor behind a serial port.
pub struct SensorLine {
    port: Port,
    lines: Lines,
    /// Time of the pending request.
    requested_at: Option<Instant>,
}

impl SensorLine {
    /// Opens a port and discards its pending input. Not real-time.
    ///
    /// # Errors
    /// One sentence with port, cause and remedy.
    pub fn open(path: &str) -> Result<Self, String> {
        let port = Port::open(path, BAUD)
            .map_err(|reason| format!("cannot open the force sensor at {path}: {reason}"))?;
        // Discard input from before the first request.
        let _ = port.discard_input();
        Ok(Self { port, lines: Lines::default(), requested_at: None })
    }

    /// Requests a reading unless a request is pending. Real-time: bounded, no allocation; one system call.
    ///
    /// # Errors
    /// If the sensor is gone.
    pub fn request(&mut self) -> Result<(), LineLost> {
        if self.requested_at.is_some() {
            return Ok(());
        }
        match self.port.write_all(QUESTION) {
            Ok(()) => self.requested_at = Some(Instant::now()),
            // The port is full: retry at the next call.
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {}
            Err(_) => return Err(LineLost),
        }
        Ok(())
    }

    /// Reads the received bytes and returns the result of the last line that they complete; a completed line ends the pending
    /// request. Real-time: bounded, no allocation; two system calls.
    ///
    /// # Errors
    /// If the sensor is gone.
    pub fn poll(&mut self) -> Result<PollResult, LineLost> {
        // Query the count first: a read without data would return an error, which allocates; and a system may wait for more bytes than
        // there are.
        let waiting = self.port.waiting().map_err(|_| LineLost)?;
        if waiting == 0 {
            return Ok(PollResult::Nothing);
        }
        let mut chunk = [0; CHUNK_BYTES];
        let room = CHUNK_BYTES.min(waiting);
        let length = self.port.read(chunk.get_mut(..room).unwrap_or_default()).map_err(|_| LineLost)?;
        if length == 0 {
            return Err(LineLost);
        }
        let mut polled = PollResult::Nothing;
        for byte in chunk.iter().take(length) {
            if let Some(line) = self.lines.push(*byte) {
                polled = parse(line).map_or(PollResult::Malformed, PollResult::Force);
                self.requested_at = None;
            }
        }
        Ok(polled)
    }

    /// Returns the text of the last line, complete or not, for errors. Not real-time.
    #[must_use]
    pub fn last(&self) -> String {
        String::from_utf8_lossy(self.lines.last()).into_owned()
    }

    /// Returns the age of the pending request; zero without one. Real-time: bounded, no allocation.
    #[must_use]
    pub fn silence(&self) -> Duration {
        self.requested_at.map_or(Duration::ZERO, |requested_at| requested_at.elapsed())
    }
}
