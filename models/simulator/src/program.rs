//! Side of the program, for simulators in Rust.

use crate::messages::{POSE_BYTES, PoseMessage, SetMessage};
use crate::platform::Socket;
use std::io;

/// Connection of a program to the run that started it.
pub struct Connection {
    socket: Socket,
}

impl Connection {
    /// Takes the standard input of this process. Not real-time.
    ///
    /// # Errors
    /// If the system does not give it, or is Windows.
    pub fn of_standard_input() -> io::Result<Self> {
        Ok(Self { socket: Socket::of_standard_input()? })
    }

    /// Waits for the newest pose; `None` at the end of the run. Not real-time.
    ///
    /// # Errors
    /// If the standard input is no socket of Flotor, or a message has another version.
    pub fn receive(&mut self) -> io::Result<Option<PoseMessage>> {
        let (mut bytes, mut newest) = ([0; POSE_BYTES + 1], None);
        loop {
            match self.socket.receive(&mut bytes) {
                Ok(0) => return Ok(None),
                Ok(size) => {
                    let message = PoseMessage::from_bytes(bytes.get(..size).unwrap_or_default());
                    newest = Some(message.map_err(io::Error::other)?);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock && newest.is_some() => {
                    return Ok(newest);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    let _ = self.socket.wait(None)?;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Sends a set. Not real-time.
    ///
    /// # Errors
    /// `BrokenPipe` at the end of the run, `WouldBlock` if Flotor has not read the sets before.
    pub fn send(&mut self, set: &SetMessage) -> io::Result<()> {
        self.socket.send(&set.to_bytes())
    }

    /// Sends bytes unchanged, for tests of malformed messages. Not real-time.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.socket.send(bytes)
    }
}
