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
pub(crate) fn access_remedy(_: &str, vendor: u16, product: u16) -> String {
    format!("close the program that uses {vendor:04x}:{product:04x}")
}

/// How to install a driver that gives programs access to a USB device.
#[cfg(feature = "usb")]
pub(crate) fn driver_remedy(vendor: u16, product: u16) -> Option<String> {
    Some(format!("give {vendor:04x}:{product:04x} the driver WinUSB, with the program Zadig"))
}

/// Whether HID can be used in a loop.
///
/// # Errors
/// Why not.
#[cfg(feature = "hid")]
pub(crate) fn hid_is_offered() -> Result<(), &'static str> {
    Err(
        "`transport` = `hid` is not offered on Windows: sending a report may take a second there, and the loop would wait for it; \
         use `serial` or `usb`",
    )
}

#[cfg(all(test, any(feature = "usb", feature = "hid")))]
mod tests {
    #[cfg(feature = "hid")]
    #[test]
    fn hid_is_refused_because_sending_would_wait() {
        use crate::transport::{Kind, open};
        let refused = open(Kind::Hid, "1209:f107").err().map(|error| error.to_string());
        assert!(refused.is_some_and(|said| said.contains("not offered on Windows")));
    }

    #[cfg(feature = "usb")]
    #[test]
    fn a_device_without_winusb_needs_a_driver() {
        let remedy = super::driver_remedy(0x1209, 0xf107).expect("there is one");
        assert!(remedy.contains("1209:f107 the driver WinUSB"), "{remedy}");
    }
}
