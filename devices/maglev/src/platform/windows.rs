//! Windows: sockets are waited for in steps of milliseconds, which are longer than a tick; ports wait a millisecond at least.

use rustix::net::sockopt::set_socket_linger;
use std::net::TcpStream;
use std::os::windows::io::AsRawSocket;
use std::time::{Duration, Instant};

/// What is left of a wait is not slept, because a sleep may take so much longer.
const AWAKE: Duration = Duration::from_millis(2);
/// Between two looks before that.
const NAP: Duration = Duration::from_millis(1);

/// The other side is to know at once when a connection is dropped. Not real-time.
pub(crate) fn reset_when_dropped(stream: &TcpStream) {
    let _ = set_socket_linger(stream, Some(Duration::ZERO));
}

/// Waits until something has come, or for a time: asks again and again. Real-time: bounded by the time, no allocation.
pub(crate) fn wait_for(stream: &TcpStream, most: Duration) {
    let until = Instant::now() + most;
    let is_silent = || {
        let nothing = stream.peek(&mut [0]);
        nothing.is_err_and(|error| error.kind() == std::io::ErrorKind::WouldBlock)
    };
    while is_silent() {
        let rest = until.saturating_duration_since(Instant::now());
        match rest {
            Duration::ZERO => return,
            rest if rest > AWAKE => std::thread::sleep(NAP),
            _ => std::thread::yield_now(),
        }
    }
}

/// The number of a connection's handle, of which the system uses 32 bits.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // as the contract says
pub(crate) fn descriptor(stream: &TcpStream) -> i32 {
    stream.as_raw_socket() as i32
}

/// What a device on USB needs to be used.
#[cfg(any(feature = "usb", feature = "hid"))]
pub(crate) fn access_remedy(subsystem: &str, vendor: u16, product: u16) -> String {
    match subsystem {
        "usb" => {
            format!("give the device {vendor:04x}:{product:04x} the driver WinUSB, with the program Zadig")
        }
        _ => format!("close the program that uses the device {vendor:04x}:{product:04x}"),
    }
}

/// Serial ports.
#[cfg(feature = "serial")]
pub(crate) mod serial {
    use serialport::{COMPort, SerialPort};
    use std::io::{self, Read, Write};
    use std::time::Duration;

    /// How a user is allowed to use one.
    pub(crate) const ACCESS_REMEDY: &str = "close the program that uses the port";

    /// A port that does not wait: it is read when something has come. A frame of some 70 bytes always finds room.
    #[derive(Debug)]
    pub struct Port(COMPort);

    impl Read for Port {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            // More than there is would be waited for.
            let room = bytes.len().min(usize::try_from(self.0.bytes_to_read()?).unwrap_or(0));
            match bytes.get_mut(..room) {
                Some(there) if room > 0 => self.0.read(there),
                _ => Err(io::ErrorKind::WouldBlock.into()),
            }
        }
    }

    impl Write for Port {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.0.flush()
        }
    }

    /// Opens one. Not real-time.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) fn open(path: &str, baud: u32) -> serialport::Result<Port> {
        // No time is for ever.
        let mut port = COMPort::open(&serialport::new(path, baud).timeout(Duration::from_millis(1)))?;
        let _ = port.write_data_terminal_ready(true);
        Ok(Port(port))
    }
}
