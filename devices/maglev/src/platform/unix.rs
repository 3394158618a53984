//! Unix: waits for sockets with `poll`, and udev rules for access to USB and HID devices.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::net::TcpStream;
use std::os::fd::AsRawFd;
use std::time::Duration;

/// Makes the system reset the connection when dropped, so that the other end detects the loss at once. Not real-time.
pub(crate) fn reset_when_dropped(stream: &TcpStream) {
    let _ = rustix::net::sockopt::set_socket_linger(stream, Some(Duration::ZERO));
}

/// Waits for data until the timeout. Real-time: bounded by the timeout, no allocation.
pub(crate) fn wait_for(stream: &TcpStream, most: Duration) {
    let most = Timespec {
        tv_sec: i64::try_from(most.as_secs()).unwrap_or(i64::MAX),
        tv_nsec: i64::from(most.subsec_nanos()),
    };
    // Errors show in the next read.
    let _ = poll(&mut [PollFd::new(stream, PollFlags::IN)], Some(&most));
}

/// Returns the file descriptor of a connection.
pub(crate) fn descriptor(stream: &TcpStream) -> i32 {
    stream.as_raw_fd()
}

/// Returns the udev rule that gives the logged-in user access to the device; `subsystem` is `usb` or `hidraw`.
#[cfg(any(feature = "usb", feature = "hid"))]
pub(crate) fn access_remedy(subsystem: &str, vendor: u16, product: u16) -> String {
    // A hidraw node has its ids on a parent.
    let key = if subsystem == "hidraw" { "ATTRS" } else { "ATTR" };
    format!(
        "put this line into /etc/udev/rules.d/70-flotor.rules, run `sudo udevadm control --reload` and reconnect \
         the device: SUBSYSTEM==\"{subsystem}\", {key}{{idVendor}}==\"{vendor:04x}\", \
         {key}{{idProduct}}==\"{product:04x}\", TAG+=\"uaccess\""
    )
}

/// Returns no instructions: the kernel has a driver for USB devices.
#[cfg(feature = "usb")]
pub(crate) fn driver_remedy(_: u16, _: u16) -> Option<String> {
    None
}

/// Checks the availability of HID in a loop: always, as the kernel takes a report at once.
///
/// # Errors
/// None on this system.
#[cfg(feature = "hid")]
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub(crate) fn hid_is_offered() -> Result<(), &'static str> {
    Ok(())
}

#[cfg(test)]
#[cfg(any(feature = "usb", feature = "hid"))]
mod tests {
    use super::*;

    #[test]
    fn the_rule_names_the_ids_where_the_subsystem_has_them() {
        let rule = |subsystem| access_remedy(subsystem, 0x1209, 0xf107);
        assert!(
            rule("usb").contains("ATTR{idVendor}==\"1209\", ATTR{idProduct}==\"f107\", TAG+=\"uaccess\"")
        );
        assert!(rule("hidraw").contains("SUBSYSTEM==\"hidraw\", ATTRS{idVendor}==\"1209\""));
    }
}
