//! Linux: detection of a USB bus, udev rule for access to the device, descriptor of a connection.

use std::net::TcpStream;
use std::os::fd::AsRawFd;

/// Remedy for USB errors other than a missing permission.
pub(crate) const OTHER_REMEDY: &str = "connect the Falcon without a hub, and try again";

/// Returns whether programs can reach a USB bus: a container has none by default.
pub(crate) fn has_bus() -> bool {
    std::path::Path::new("/dev/bus/usb").is_dir()
}

/// Returns the remedy for a missing permission: a udev rule.
pub(crate) fn access_remedy(vendor: u16, product: u16) -> String {
    format!(
        "put this line into /etc/udev/rules.d/70-flotor.rules, run `sudo udevadm control --reload` and reconnect \
         the device: SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{vendor:04x}\", ATTR{{idProduct}}==\"{product:04x}\", \
         TAG+=\"uaccess\", \
         ENV{{ID_MM_DEVICE_IGNORE}}=\"1\""
    )
}

/// Returns the file descriptor of a connection.
pub(crate) fn descriptor(stream: &TcpStream) -> i32 {
    stream.as_raw_fd()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_names_the_device() {
        let rule = access_remedy(0x0403, 0xcb48);
        assert!(
            rule.contains("ATTR{idProduct}==\"cb48\", TAG+=\"uaccess\", ENV{ID_MM_DEVICE_IGNORE}"),
            "{rule}"
        );
    }
}
