//! Windows: communication ports.

use std::os::windows::io::AsRawHandle;
use std::time::Duration;

/// A serial port.
pub(crate) type Port = serialport::COMPort;

/// How long a read or a write waits at most: no time is for ever, and the shortest is a millisecond. Nothing is read before it has
/// arrived, and a request of a few bytes always finds room.
pub(crate) const PATIENCE: Duration = Duration::from_millis(1);

/// What the parameter `port` is.
pub(crate) const PORT_HELP: &str = "Where the board is, as COM3";
/// What it may be.
pub(crate) const PORT_EXAMPLE: &str = "COM3";
/// How a user finds it.
pub(crate) const PORT_LIST: &str = "the Device Manager lists the ports";
/// How a user is allowed to use it.
pub(crate) const ACCESS_REMEDY: &str = "close the program that uses it";

/// The number of a port's handle, of which the system uses 32 bits.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // as the contract says
pub(crate) fn descriptor(port: &Port) -> i32 {
    port.as_raw_handle() as usize as i32
}
