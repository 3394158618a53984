//! Attachment of devices to the kernel's `vhci_hcd`, through sysfs.

use std::io::{self, ErrorKind};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;

const FOLDER: &str = "/sys/devices/platform/vhci_hcd.0";
/// USB speed of a device, with the value of the kernel's `enum usb_device_speed`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Full speed, 12 Mbit/s: frames of 1 ms.
    Full = 2,
    /// High speed, 480 Mbit/s: microframes of 125 µs.
    High = 3,
}

/// State of a port without a device (`VDEV_ST_NULL`).
const FREE: &str = "004";
/// Bus number at the remote end of the device; an arbitrary value.
const FAR_BUS: u32 = 1 << 16;

/// Attaches the USB/IP device at the other end of `stream` to a free virtual port; the kernel then enumerates the device
/// at `speed`.
///
/// # Errors
/// Errors of the system: usually the module `vhci_hcd` is not loaded, or the user has no permission. `ResourceBusy` if no virtual
/// port is free.
pub fn attach(stream: &UnixStream, speed: Speed) -> io::Result<()> {
    let explained = |error: io::Error| {
        let hint = match error.kind() {
            ErrorKind::NotFound => "load the kernel module: sudo modprobe vhci_hcd",
            ErrorKind::PermissionDenied => "only root may attach a device; use sudo",
            _ => "no virtual port accepted the device; end other programs that emulate USB devices",
        };
        io::Error::new(error.kind(), format!("{FOLDER}: {error}; {hint}"))
    };
    let status = std::fs::read_to_string(format!("{FOLDER}/status")).map_err(explained)?;
    let port = free_port(&status).ok_or_else(|| explained(ErrorKind::ResourceBusy.into()))?;
    let line = format!("{port} {} {} {}", stream.as_raw_fd(), FAR_BUS + port + 1, speed as u32);
    // The kernel takes a reference of its own; the caller may close the stream.
    std::fs::write(format!("{FOLDER}/attach"), line).map_err(explained)
}

/// Returns the first free port up to high speed in the controller's table: `hub port sta spd dev sockfd local_busid`.
fn free_port(status: &str) -> Option<u32> {
    status.lines().find_map(|line| {
        let mut words = line.split_whitespace();
        let (hub, port, state) = (words.next()?, words.next()?, words.next()?);
        if hub == "hs" && state == FREE { port.parse().ok() } else { None }
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_port_is_taken_once() {
        let table = "hub port sta spd dev      sockfd local_busid\n\
                     hs  0000 006 003 00010001 000003 1-1\n\
                     hs  0001 004 000 00000000 000000 0-0\n\
                     ss  0008 004 000 00000000 000000 0-0\n";
        assert_eq!(super::free_port(table), Some(1));
        assert_eq!(super::free_port("hub port sta\nss 0008 004 000 0 0 0-0\n"), None);
    }
}
