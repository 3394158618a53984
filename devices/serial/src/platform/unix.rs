//! Unix: terminals.

use crate::NotOpened;
use serialport::{Error, ErrorKind, TTYPort};
use std::io::{self, Read};
use std::os::fd::AsRawFd;
use std::path::Path;
use std::time::Duration;

pub(crate) type System = TTYPort;

/// Help text of a parameter `port`.
pub(crate) const PORT_HELP: &str =
    "Path of the serial port, such as /dev/ttyACM0 or a path below /dev/serial/by-id; required";
/// Example of a parameter `port`.
pub(crate) const PORT_EXAMPLE: &str = "/dev/ttyACM0";
/// Advice for listing the ports.
pub(crate) const PORT_LIST: &str = "`ls /dev/serial/by-id` lists the USB serial ports";

/// Timeout of reads and writes: zero, so that neither blocks.
pub(crate) const PATIENCE: Duration = Duration::ZERO;

/// Maps an error of opening to its cause.
pub(crate) fn reason(path: &str, error: Error) -> NotOpened {
    let is_there = || Path::new(path).exists();
    match error.kind() {
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => NotOpened::Forbidden {
            remedy: "add the user to the group of the port (`sudo usermod -aG dialout $USER`, then log in again)",
        },
        // The second program on a port finds it locked (TIOCEXCL), which serialport reports like this.
        ErrorKind::NoDevice if is_there() => NotOpened::InUse,
        ErrorKind::Unknown if is_there() => NotOpened::NoPort,
        _ => NotOpened::Missing { cause: error.description },
    }
}

/// Reads pending bytes without blocking and returns their number; an error if no bytes are pending.
pub(crate) fn read(port: &mut TTYPort, bytes: &mut [u8]) -> io::Result<usize> {
    port.read(bytes)
}

/// Returns the descriptor of a port.
pub(crate) fn descriptor(port: &TTYPort) -> i32 {
    port.as_raw_fd()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Port;
    use serialport::SerialPort;
    use std::io::Write;

    #[test]
    fn each_reason_is_that_of_the_system() {
        let (_ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
        let path = theirs.name().expect("a pseudo terminal has a path");
        drop(theirs);
        let _first = Port::open(&path, 9600).expect("it is free");
        let in_use = Port::open(&path, 9600).expect_err("one at a time");
        assert_eq!(in_use, NotOpened::InUse);
        assert_eq!(in_use.to_string(), "another program uses the port; close that program first");
        let file = tempfile::NamedTempFile::new().expect("there is room");
        let file = file.path().to_str().expect("its name is text");
        assert_eq!(Port::open(file, 9600).err(), Some(NotOpened::NoPort));
        // Root may use every file: the error is that of the system, not asked for here.
        let refused = Error::from(io::Error::from_raw_os_error(13));
        let refused = reason("/dev/ttyACM0", refused);
        assert!(matches!(refused, NotOpened::Forbidden { .. }));
        assert!(
            refused.to_string().starts_with("this user may not open the port; add the user to the group"),
            "{refused}"
        );
        let nowhere = Port::open("/dev/nowhere", 9600).expect_err("there is none").to_string();
        assert!(
            nowhere.ends_with(
                "; check that the device is connected; `ls /dev/serial/by-id` lists the USB serial ports"
            ),
            "{nowhere}"
        );
    }

    #[test]
    fn a_port_that_nobody_reads_takes_no_more_and_is_not_gone() {
        let (_ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
        let path = theirs.name().expect("a pseudo terminal has a path");
        drop(theirs);
        let mut port = Port::open(&path, 9600).expect("it is free");
        let full = std::iter::repeat_with(|| port.write_all(&[b'x'; 64])).take(10_000).find_map(Result::err);
        let kind = full.expect("no port takes so much").kind();
        assert!(matches!(kind, io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut), "{kind}");
    }
}
