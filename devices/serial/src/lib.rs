//! Non-blocking serial port, shared by device plugins.
//!
//! - [`Port`]: a non-blocking port, on every system.
//! - [`NotOpened`]: error of opening a port, with its remedy.
//! - [`PORT_HELP`], [`PORT_EXAMPLE`]: help and example of a plugin's parameter `port`.

mod platform;

use serialport::{ClearBuffer, SerialPort};
use std::io::{self, Read, Write};

/// Help text of a plugin's parameter `port`.
pub const PORT_HELP: &str = platform::PORT_HELP;
/// Example of a parameter `port`.
pub const PORT_EXAMPLE: &str = platform::PORT_EXAMPLE;

/// A non-blocking serial port: a read without data and a write to a full buffer return [`io::ErrorKind::WouldBlock`] or
/// [`io::ErrorKind::TimedOut`]. On Windows the shortest timeout is 1 ms, and a write to a full buffer blocks for that
/// time.
#[derive(Debug)]
pub struct Port(platform::System);

/// Error of opening a port. Displays as the cause and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotOpened {
    /// This user has no permission.
    #[error("this user may not open the port; {remedy}")]
    Forbidden {
        /// Remedy, as a clause.
        remedy: &'static str,
    },
    /// Another program uses the port.
    #[error("another program uses the port; close that program first")]
    InUse,
    /// The path is not a serial port.
    #[error("the file is not a usable serial port; {}", platform::PORT_LIST)]
    NoPort,
    /// There is no file at the path, or another error of the system.
    #[error("{cause}; check that the device is connected; {}", platform::PORT_LIST)]
    Missing {
        /// Error of the system, as text.
        cause: String,
    },
}

impl Port {
    /// Opens the port with the system's path or name (`/dev/ttyACM0`, `COM3`) at the rate `baud`. Not real-time.
    ///
    /// # Errors
    /// [`NotOpened`], with the cause and the remedy.
    pub fn open(path: &str, baud: u32) -> Result<Self, NotOpened> {
        let builder = serialport::new(path, baud).timeout(platform::PATIENCE);
        platform::System::open(&builder).map(Self).map_err(|error| platform::reason(path, error))
    }

    /// Returns a second handle of the port, for another thread. Not real-time.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn second(&self) -> io::Result<Self> {
        Ok(Self(self.0.try_clone_native()?))
    }

    /// Sets the modem line DTR, if the port has one, to signal that a program is connected. Not real-time.
    pub fn announce(&mut self) {
        // A port without modem lines (a pseudo terminal) returns an error, and works.
        let _ = self.0.write_data_terminal_ready(true);
    }

    /// Returns the number of bytes received and not yet read. Real-time: bounded, no allocation; one system call.
    ///
    /// # Errors
    /// If the port is gone.
    pub fn waiting(&self) -> io::Result<usize> {
        Ok(usize::try_from(self.0.bytes_to_read()?).unwrap_or(usize::MAX))
    }

    /// Discards the bytes received and not yet read. Real-time: bounded, no allocation; one system call.
    ///
    /// # Errors
    /// If the port is gone.
    pub fn discard_input(&self) -> io::Result<()> {
        Ok(self.0.clear(ClearBuffer::Input)?)
    }

    /// Returns the file descriptor of the port, on Windows the lower 32 bits of its handle, for the declaration of an
    /// independent stop in the plugin contract.
    #[must_use]
    pub fn descriptor(&self) -> i32 {
        platform::descriptor(&self.0)
    }
}

impl Read for Port {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        platform::read(&mut self.0, bytes)
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        taken(self.0.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Converts a write of zero bytes to `WouldBlock`: Windows writes zero bytes on a timeout, and `write_all` would conclude
/// that the port is closed.
fn taken(written: io::Result<usize>) -> io::Result<usize> {
    match written {
        Ok(0) => Err(io::ErrorKind::WouldBlock.into()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes a few bytes, then none, as a port of Windows whose other end has stopped.
    struct Stalled(usize);

    impl Write for Stalled {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let room = self.0.min(bytes.len());
            self.0 -= room;
            taken(Ok(room))
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_port_without_room_is_full_and_not_gone() {
        assert!(Stalled(5).write_all(b"abcde").is_ok());
        let full = Stalled(3).write_all(b"abcde").expect_err("two bytes have no room");
        assert_eq!(full.kind(), io::ErrorKind::WouldBlock);
    }

    #[test]
    fn where_nothing_is_the_system_says_so() {
        assert!(
            matches!(Port::open("/nowhere/COM999", 9600), Err(NotOpened::Missing { cause }) if !cause.is_empty())
        );
    }
}
