//! Serial ports: RS-232 adapters, USB CDC ports, pseudo terminals.

use super::OpenError;
use super::stream::StreamLink;
use crate::platform::serial::{self, Port};
use serialport::ErrorKind;

/// 64 bytes a millisecond each way need 660 kbit/s with start and stop bits; USB CDC ports ignore the number.
const BAUD: u32 = 2_000_000;

/// Opens a serial port by its path. Not real-time.
///
/// # Errors
/// [`OpenError`].
pub fn open(path: &str) -> Result<StreamLink<Port>, OpenError> {
    let port = serial::open(path, BAUD).map_err(|error| refused(path, &error))?;
    Ok(StreamLink::new(port))
}

fn refused(path: &str, error: &serialport::Error) -> OpenError {
    let address = path.to_owned();
    match error.kind() {
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => {
            OpenError::Forbidden { address, remedy: serial::ACCESS_REMEDY.to_owned() }
        }
        // The second program on a port finds it locked (TIOCEXCL), which serialport reports like this.
        ErrorKind::NoDevice if std::fs::metadata(path).is_ok() => OpenError::Busy { address },
        _ => OpenError::Missing { address, cause: error.description.clone() },
    }
}
