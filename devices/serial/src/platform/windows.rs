//! Windows: communication ports.

use crate::NotOpened;
use serialport::{COMPort, Error, ErrorKind, SerialPort};
use std::io::{self, Read};
use std::os::windows::io::AsRawHandle;
use std::time::Duration;

pub(crate) type System = COMPort;

/// Help text of a parameter `port`.
pub(crate) const PORT_HELP: &str = "Name of the serial port, such as COM3; required";
/// Example of a parameter `port`.
pub(crate) const PORT_EXAMPLE: &str = "COM3";
/// Advice for listing the ports.
pub(crate) const PORT_LIST: &str = "the Device Manager lists the ports";

/// Timeout of writes: zero would mean no timeout, and the shortest is a millisecond.
pub(crate) const PATIENCE: Duration = Duration::from_millis(1);

/// `ERROR_ACCESS_DENIED`: for a port, another program has it open.
const ACCESS_DENIED: i32 = 5;

/// Maps an error of opening to its cause.
pub(crate) fn reason(_: &str, error: Error) -> NotOpened {
    match error.kind() {
        // serialport has one kind for a missing port and a port in use: the system's text distinguishes them, in any language.
        ErrorKind::NoDevice if error.description == words(ACCESS_DENIED) => NotOpened::InUse,
        _ => NotOpened::Missing { cause: error.description },
    }
}

/// Returns the system's text of an error code.
fn words(code: i32) -> String {
    let said = io::Error::from_raw_os_error(code).to_string();
    said.strip_suffix(&format!(" (os error {code})")).unwrap_or(&said).trim().to_owned()
}

/// Reads pending bytes without blocking and returns their number; `WouldBlock` if no bytes are pending. A request for more than
/// the pending bytes would block.
pub(crate) fn read(port: &mut COMPort, bytes: &mut [u8]) -> io::Result<usize> {
    let room = bytes.len().min(usize::try_from(port.bytes_to_read()?).unwrap_or(0));
    match bytes.get_mut(..room) {
        Some(there) if room > 0 => port.read(there),
        _ => Err(io::ErrorKind::WouldBlock.into()),
    }
}

/// Returns the lower 32 bits of a port's handle; the system uses no others.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // as the contract says
pub(crate) fn descriptor(port: &COMPort) -> i32 {
    port.as_raw_handle() as usize as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Port;

    #[test]
    fn what_the_system_does_not_give_is_in_use() {
        // A folder is refused with the same error as a port that another program has.
        assert_eq!(Port::open(r"\\?\C:\windows", 9600).err(), Some(NotOpened::InUse));
        let nowhere = Port::open("COM999", 9600).err();
        assert!(matches!(nowhere, Some(NotOpened::Missing { .. })), "{nowhere:?}");
    }
}
