//! Unix: terminals.

use std::os::fd::AsRawFd;
use std::time::Duration;

/// A serial port.
pub(crate) type Port = serialport::TTYPort;

/// How long a read or a write waits: not at all.
pub(crate) const PATIENCE: Duration = Duration::ZERO;

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the board is, as /dev/ttyACM0 or a path below /dev/serial/by-id";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "/dev/ttyACM0";
/// How a user finds it.
pub(crate) const PORT_LIST: &str = "`ls /dev/serial/by-id` lists the ports";
/// How a user is allowed to use it.
pub(crate) const ACCESS_REMEDY: &str =
    "add the user to the group of the port (`sudo usermod -aG dialout $USER`, then log in anew)";

/// The descriptor of a port.
pub(crate) fn descriptor(port: &Port) -> i32 {
    port.as_raw_fd()
}
