//! One question at a time over a serial port.

use crate::protocol::{Lines, QUESTION, parse};
use flotor_serial::Port;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

/// Speed of the line, baud: what microcontrollers' boards start with.
const BAUD: u32 = 115_200;
/// Bytes looked at at once: several answers.
const CHUNK_BYTES: usize = 256;

/// The port is closed, or the sensor unplugged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineLost;

/// What came of a look at the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heard {
    /// Nothing yet.
    Nothing,
    /// A force, N.
    Force(f64),
    /// A line that is no force: [`SensorLine::last`] has it.
    Nonsense,
}

/// A sensor at the other end of a serial port.
pub struct SensorLine {
    port: Port,
    lines: Lines,
    /// When the question that waits for its answer was asked.
    asked: Option<Instant>,
}

impl SensorLine {
    /// Opens a port. Not real-time.
    ///
    /// # Errors
    /// One sentence: port, cause and remedy.
    pub fn open(path: &str) -> Result<Self, String> {
        let port = Port::open(path, BAUD).map_err(|reason| format!("no force sensor at {path}: {reason}"))?;
        // What it said before anybody asked.
        let _ = port.forget_input();
        Ok(Self { port, lines: Lines::default(), asked: None })
    }

    /// Asks, unless a question waits for its answer. Real-time: bounded, no allocation; one call of the system.
    ///
    /// # Errors
    /// [`LineLost`].
    pub fn ask(&mut self) -> Result<(), LineLost> {
        if self.asked.is_some() {
            return Ok(());
        }
        match self.port.write_all(QUESTION) {
            Ok(()) => self.asked = Some(Instant::now()),
            // The port is full: asked again next time.
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {}
            Err(_) => return Err(LineLost),
        }
        Ok(())
    }

    /// What has arrived; the last line counts. Real-time: bounded, no allocation; two calls of the system.
    ///
    /// # Errors
    /// [`LineLost`].
    pub fn hear(&mut self) -> Result<Heard, LineLost> {
        // Asked beforehand: a read without anything to read would make an error, and an error is an allocation; and a system may wait
        // for more than there is.
        let waiting = self.port.waiting().map_err(|_| LineLost)?;
        if waiting == 0 {
            return Ok(Heard::Nothing);
        }
        let mut chunk = [0; CHUNK_BYTES];
        let room = CHUNK_BYTES.min(waiting);
        let length = self.port.read(chunk.get_mut(..room).unwrap_or_default()).map_err(|_| LineLost)?;
        if length == 0 {
            return Err(LineLost);
        }
        let mut heard = Heard::Nothing;
        for byte in chunk.iter().take(length) {
            if let Some(line) = self.lines.push(*byte) {
                heard = parse(line).map_or(Heard::Nonsense, Heard::Force);
                self.asked = None;
            }
        }
        Ok(heard)
    }

    /// The last line, as far as it has come.
    #[must_use]
    pub fn last(&self) -> String {
        String::from_utf8_lossy(self.lines.last()).into_owned()
    }

    /// How long a question has been without an answer. Real-time: bounded, no allocation.
    #[must_use]
    pub fn silence(&self) -> Duration {
        self.asked.map_or(Duration::ZERO, |asked| asked.elapsed())
    }
}
