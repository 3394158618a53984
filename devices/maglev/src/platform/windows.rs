//! Windows: sockets are waited for in steps of milliseconds, which are longer than a tick.

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
