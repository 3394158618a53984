//! Program of a simulator: its start, its socket and its end.

use crate::answers::{Answers, OutOfOrder};
use crate::messages::{MOST_BYTES, Malformed, PoseMessage, SetMessage};
use crate::platform::Socket;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};
use std::{fmt, thread};

/// Most messages that are read in one call: more than a program at 100 kHz sends in a period of 100 Hz.
const MOST_MESSAGES: usize = 2000;
/// Time for the end of a program after that of its socket.
const FAREWELL: Duration = Duration::from_millis(200);

/// Reason why a simulator gives no more force.
#[derive(Debug)]
pub enum LinkError {
    /// It did not start.
    Start {
        /// Program.
        program: PathBuf,
        /// Cause.
        cause: io::Error,
    },
    /// It has ended.
    Ended {
        /// Program.
        program: PathBuf,
        /// How, as far as known.
        status: Option<ExitStatus>,
    },
    /// The socket failed.
    Socket {
        /// Program.
        program: PathBuf,
        /// Cause.
        cause: io::Error,
    },
    /// A message is no set.
    Malformed {
        /// Program.
        program: PathBuf,
        /// Cause.
        cause: Malformed,
    },
    /// A set is for the wrong pose.
    OutOfOrder {
        /// Program.
        program: PathBuf,
        /// Cause.
        cause: OutOfOrder,
    },
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start { program, cause } => write!(
                f,
                "the simulator `{}` does not start: {cause}; `program` is the path of an executable file",
                program.display()
            ),
            Self::Ended { program, status: Some(status) } => {
                write!(f, "the simulator `{}` has ended ({status}) before the run", program.display())
            }
            Self::Ended { program, status: None } => {
                write!(
                    f,
                    "the simulator `{}` has closed its socket before the end of the run",
                    program.display()
                )
            }
            Self::Socket { program, cause } => {
                write!(f, "the socket of the simulator `{}` failed: {cause}", program.display())
            }
            Self::Malformed { program, cause } => {
                write!(f, "the simulator `{}` sent what is no set: {cause}", program.display())
            }
            Self::OutOfOrder { program, cause } => {
                write!(f, "the simulator `{}` sent {cause}", program.display())
            }
        }
    }
}

impl std::error::Error for LinkError {}

/// Running program.
pub struct Link {
    program: PathBuf,
    process: Child,
    socket: Option<Socket>,
    bytes: Box<[u8; MOST_BYTES]>,
}

impl Link {
    /// Starts a program with a socket as its standard input. Not real-time.
    ///
    /// # Errors
    /// [`LinkError::Start`].
    pub fn start(program: &Path) -> Result<Self, LinkError> {
        let started = Socket::start(program);
        let (socket, process) =
            started.map_err(|cause| LinkError::Start { program: program.to_owned(), cause })?;
        Ok(Self {
            program: program.to_owned(),
            process,
            socket: Some(socket),
            bytes: Box::new([0; MOST_BYTES]),
        })
    }

    /// Sends a pose, which is lost if the program has not read those before. Not real-time.
    ///
    /// # Errors
    /// If the program has ended, or the socket fails.
    pub fn send(&mut self, pose: &PoseMessage) -> Result<(), LinkError> {
        let Some(socket) = &self.socket else { return Err(self.ended()) };
        match socket.send(&pose.to_bytes()) {
            Ok(()) => Ok(()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::BrokenPipe | ErrorKind::ConnectionReset) => {
                Err(self.ended())
            }
            Err(cause) => Err(LinkError::Socket { program: self.program.clone(), cause }),
        }
    }

    /// Reads the sets that have come. Not real-time.
    ///
    /// # Errors
    /// If the program has ended, the socket fails, or a message is no set or out of order.
    pub fn read(&mut self, answers: &mut Answers) -> Result<(), LinkError> {
        for _ in 0..MOST_MESSAGES {
            let Some(socket) = &self.socket else { return Err(self.ended()) };
            let size = match socket.receive(&mut self.bytes[..]) {
                Ok(0) => return Err(self.ended()),
                Ok(size) => size,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(cause) => return Err(LinkError::Socket { program: self.program.clone(), cause }),
            };
            let message = self.bytes.get(..size).ok_or(Malformed::Size { bytes: size });
            let set = message.and_then(SetMessage::from_bytes);
            let set = set.map_err(|cause| LinkError::Malformed { program: self.program.clone(), cause })?;
            let taken = answers.take(set);
            taken.map_err(|cause| LinkError::OutOfOrder { program: self.program.clone(), cause })?;
        }
        Ok(())
    }

    /// Reads sets up to that for the pose `number`; returns false without one within `most`. Not real-time.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn wait(&mut self, number: u64, answers: &mut Answers, most: Duration) -> Result<bool, LinkError> {
        let until = Instant::now() + most;
        loop {
            self.read(answers)?;
            let left = until.saturating_duration_since(Instant::now());
            if answers.has(number) || left.is_zero() {
                return Ok(answers.has(number));
            }
            if let Some(socket) = &self.socket {
                let waited = socket.wait(Some(left));
                let _ = waited.map_err(|cause| LinkError::Socket { program: self.program.clone(), cause })?;
            }
        }
    }

    /// Closes the socket and returns how the program has ended.
    fn ended(&mut self) -> LinkError {
        self.socket = None;
        LinkError::Ended { program: self.program.clone(), status: self.farewell() }
    }

    /// Waits a moment for the end of the program.
    fn farewell(&mut self) -> Option<ExitStatus> {
        let until = Instant::now() + FAREWELL;
        loop {
            if let Ok(Some(status)) = self.process.try_wait() {
                return Some(status);
            }
            if Instant::now() >= until {
                return None;
            }
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Link {
    /// Closes the socket, the end of the run for the program, and kills a program that continues.
    fn drop(&mut self) {
        self.socket = None;
        if self.farewell().is_none() {
            let _ = self.process.kill(); // it may have ended meanwhile
            let _ = self.process.wait();
        }
    }
}
