//! A force sensor on a serial port, and one that is emulated on a pseudo terminal.
//!
//! The protocol is lines of ASCII, so that a terminal program and a twenty-line sketch on a microcontroller speak it:
//!
//! | host | sensor | |
//! |---|---|---|
//! | `R` | `F 1.234` | read: the vertical force on the sensor, N, upwards positive |
//! | anything else, or out of range | `E words` | what is wrong |
//!
//! Lines end in a line feed; a carriage return before it is not looked at.

use serialport::{ErrorKind, SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Speed of the line, baud: what microcontrollers' boards start with.
pub const BAUD: u32 = 115_200;
/// A slow sensor averages for a tenth of a second.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long one look at the line takes at most.
const LOOK: Duration = Duration::from_millis(20);
/// Longest line: a number of any precision, or a sentence.
const LONGEST_LINE: usize = 200;
/// More than any sensor for this has, N.
const PLAUSIBLE_N: f64 = 500.0;

/// Why there is no force. Prints port, cause and remedy in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// The port cannot be opened.
    #[error("no force sensor at {port}: {cause}; is it connected, and may this user use it (group dialout)?")]
    Closed {
        /// The port.
        port: String,
        /// What the system said.
        cause: String,
    },
    /// It ended, or was unplugged.
    #[error("the force sensor at {port} is gone: {cause}; plug it in and measure again")]
    Gone {
        /// The port.
        port: String,
        /// What the system said.
        cause: String,
    },
    /// It says nothing.
    #[error("the force sensor at {port} does not answer within {} s; is it one that answers `R`, at {BAUD} baud?", PATIENCE.as_secs())]
    Silent {
        /// The port.
        port: String,
    },
    /// It says something else than a force.
    #[error("the force sensor at {port} answers `{answer}` instead of a force like `F 1.234`")]
    Nonsense {
        /// The port.
        port: String,
        /// What it said.
        answer: String,
    },
}

/// An open force sensor.
pub struct ForceSensor {
    port: String,
    line: TTYPort,
}

impl ForceSensor {
    /// Opens the port. Not real-time.
    ///
    /// # Errors
    /// [`SensorError::Closed`].
    pub fn open(port: &str) -> Result<Self, SensorError> {
        let line = TTYPort::open(&serialport::new(port, BAUD).timeout(LOOK));
        let line = line.map_err(|error| {
            let busy = error.kind() == ErrorKind::NoDevice && std::path::Path::new(port).exists();
            let cause = if busy { "another program uses it".to_owned() } else { error.description };
            SensorError::Closed { port: port.to_owned(), cause }
        })?;
        Ok(Self { port: port.to_owned(), line })
    }

    /// Asks for one reading, N. Not real-time.
    ///
    /// # Errors
    /// [`SensorError`], but [`SensorError::Closed`].
    pub fn read_n(&mut self) -> Result<f64, SensorError> {
        let gone =
            |cause: std::io::Error| SensorError::Gone { port: self.port.clone(), cause: cause.to_string() };
        // What was said to an earlier question that nobody waited for is not the answer to this one.
        self.line.clear(serialport::ClearBuffer::Input).map_err(|error| gone(error.into()))?;
        self.line.write_all(b"R\n").map_err(gone)?;
        match read_line(&mut self.line, &mut Vec::new(), PATIENCE).map_err(gone)? {
            None => Err(SensorError::Silent { port: self.port.clone() }),
            Some(answer) => parse(&answer).ok_or(SensorError::Nonsense { port: self.port.clone(), answer }),
        }
    }
}

/// The force in an answer.
fn parse(answer: &str) -> Option<f64> {
    let force_n: f64 = answer.strip_prefix("F ")?.trim().parse().ok()?;
    (force_n.abs() <= PLAUSIBLE_N).then_some(force_n)
}

/// Reads up to the end of a line; nothing if it does not end in time: what came of it so far stays in `text`.
fn read_line(line: &mut TTYPort, text: &mut Vec<u8>, patience: Duration) -> std::io::Result<Option<String>> {
    let started = Instant::now();
    while started.elapsed() < patience {
        let mut byte = [0];
        match line.read(&mut byte) {
            Ok(0) => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            Ok(_) if byte == *b"\n" => {
                let whole = std::mem::take(text);
                return Ok(Some(String::from_utf8_lossy(&whole).trim_end().to_owned()));
            }
            Ok(_) if text.len() < LONGEST_LINE => text.extend(byte),
            Ok(_) => return Ok(Some(String::from_utf8_lossy(&std::mem::take(text)).into_owned())),
            Err(error)
                if matches!(error.kind(), std::io::ErrorKind::TimedOut | std::io::ErrorKind::Interrupted) => {
            }
            Err(error) => return Err(error),
        }
    }
    Ok(None)
}

/// A force sensor without one: answers on a pseudo terminal with the force it was last told.
pub struct EmulatedSensor {
    port: String,
    /// Bits of the force, N.
    force: Arc<AtomicU64>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl EmulatedSensor {
    /// Starts one. Not real-time.
    ///
    /// # Errors
    /// What the system says: usually that there are no pseudo terminals.
    pub fn start() -> std::io::Result<Self> {
        let (mut ours, theirs) = TTYPort::pair()?;
        ours.set_timeout(LOOK)?;
        let port = theirs.name().ok_or(std::io::ErrorKind::Unsupported)?;
        let (force, ending) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
        let (told, end) = (Arc::clone(&force), Arc::clone(&ending));
        let thread = std::thread::Builder::new().name("flotor-sensor".to_owned()).spawn(move || {
            // Held open, or the terminal hangs up whenever nobody listens.
            let _theirs = theirs;
            let mut text = Vec::new();
            while !end.load(Ordering::Acquire) {
                let answer = match read_line(&mut ours, &mut text, LOOK) {
                    Ok(None) => continue,
                    // All digits: what is read is what was told.
                    Ok(Some(asked)) if asked == "R" => {
                        format!("F {}\n", f64::from_bits(told.load(Ordering::Acquire)))
                    }
                    Ok(Some(_)) => "E only R is understood\n".to_owned(),
                    Err(_) => return,
                };
                if ours.write_all(answer.as_bytes()).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { port, force, ending, thread: Some(thread) })
    }

    /// The path a [`ForceSensor`] is opened by.
    #[must_use]
    pub fn port(&self) -> &str {
        &self.port
    }

    /// What it feels from now on, N.
    pub fn press(&self, force_n: f64) {
        self.force.store(force_n.to_bits(), Ordering::Release);
    }
}

impl Drop for EmulatedSensor {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pressed_is_read() {
        let emulated = EmulatedSensor::start().unwrap();
        let mut sensor = ForceSensor::open(emulated.port()).unwrap();
        for force_n in [0.0, 1.25, -3.333_333_333_333, 1.0e-9] {
            emulated.press(force_n);
            assert_eq!(sensor.read_n(), Ok(force_n));
        }
        // A sensor that sends more than it is asked for: old answers are not read as new ones.
        sensor.line.write_all(b"R\nR\n").unwrap();
        std::thread::sleep(Duration::from_millis(100));
        emulated.press(7.0);
        assert_eq!(sensor.read_n(), Ok(7.0));
    }

    #[test]
    fn what_is_no_force_is_told_as_it_was_said() {
        for (answer, force_n) in
            [("F 1.5", Some(1.5)), ("F -2e-1", Some(-0.2)), ("F  3 ", Some(3.0)), ("F 501", None)]
        {
            assert_eq!(parse(answer), force_n, "{answer}");
        }
        for answer in ["", "F", "F nan", "F inf", "E overload", "1.5", "F 1,5"] {
            assert_eq!(parse(answer), None, "{answer}");
        }
        let missing = ForceSensor::open("/dev/no-such-port").err().unwrap().to_string();
        assert!(missing.contains("no force sensor at /dev/no-such-port"), "{missing}");
    }
}
