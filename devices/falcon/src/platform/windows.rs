//! Windows: remedies for USB errors (libusb needs the driver WinUSB), and the socket handle of a connection.

use std::net::TcpStream;
use std::os::windows::io::AsRawSocket;

/// Remedy for USB errors other than a missing permission.
pub(crate) const OTHER_REMEDY: &str = "install the driver WinUSB for the Falcon with the program Zadig, connect the Falcon without a hub, and try again";

/// Returns true: programs can always reach a USB bus.
pub(crate) fn has_bus() -> bool {
    true
}

/// Returns the remedy for a missing permission: another driver.
pub(crate) fn access_remedy(vendor: u16, product: u16) -> String {
    format!(
        "close the program that uses {vendor:04x}:{product:04x}, or install the driver WinUSB for the device with the program Zadig"
    )
}

/// Returns the socket handle of a connection; the system uses only its lower 32 bits.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // as the contract says
pub(crate) fn descriptor(stream: &TcpStream) -> i32 {
    stream.as_raw_socket() as i32
}
