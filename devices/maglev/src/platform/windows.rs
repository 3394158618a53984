//! Windows: socket waits have a resolution of milliseconds, longer than a tick.

use rustix::net::sockopt::set_socket_linger;
use std::net::TcpStream;
use std::os::windows::io::AsRawSocket;
use std::time::{Duration, Instant};

/// Last part of a wait, polled without sleep because a sleep may overrun by as much.
const AWAKE: Duration = Duration::from_millis(2);
/// Poll interval before the last part.
const NAP: Duration = Duration::from_millis(1);

/// Makes the system reset the connection when dropped, so that the other end detects the loss at once. Not real-time.
pub(crate) fn reset_when_dropped(stream: &TcpStream) {
    let _ = set_socket_linger(stream, Some(Duration::ZERO));
}

/// Waits for data until the timeout, by polling. Real-time: bounded by the timeout, no allocation.
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

/// Returns the lower 32 bits of a connection's handle; the system uses no others.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // as the contract says
pub(crate) fn descriptor(stream: &TcpStream) -> i32 {
    stream.as_raw_socket() as i32
}

/// Returns instructions for access to a USB device.
#[cfg(any(feature = "usb", feature = "hid"))]
pub(crate) fn access_remedy(_: &str, vendor: u16, product: u16) -> String {
    format!("close the program that uses {vendor:04x}:{product:04x}")
}

/// Returns instructions for installing a driver with access for programs.
#[cfg(feature = "usb")]
pub(crate) fn driver_remedy(vendor: u16, product: u16) -> Option<String> {
    Some(format!("install the driver WinUSB for {vendor:04x}:{product:04x} with the program Zadig"))
}

/// Checks the availability of HID in a loop.
///
/// # Errors
/// Always, with the reason.
#[cfg(feature = "hid")]
pub(crate) fn hid_is_offered() -> Result<(), &'static str> {
    Err(
        "`transport` = `hid` is not supported on Windows, where sending a report may block the loop for a second; \
         use `serial` or `usb`",
    )
}

#[cfg(all(test, any(feature = "usb", feature = "hid")))]
mod tests {
    #[cfg(feature = "hid")]
    #[test]
    fn hid_is_refused_because_sending_would_wait() {
        assert!(super::hid_is_offered().is_err_and(|reason| reason.contains("not supported on Windows")));
    }

    #[cfg(feature = "usb")]
    #[test]
    fn a_device_without_winusb_needs_a_driver() {
        let remedy = super::driver_remedy(0x1209, 0xf107).expect("there is one");
        assert!(remedy.contains("the driver WinUSB for 1209:f107"), "{remedy}");
    }
}
