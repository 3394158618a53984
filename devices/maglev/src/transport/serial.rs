//! Serial ports: RS-232 adapters, USB CDC ports, pseudo terminals.

use super::OpenError;
use super::stream::StreamLink;
use flotor_serial::{NotOpened, Port};

/// Baud rate: 64 bytes a millisecond each way need 660 kbit/s with start and stop bits; USB CDC ports ignore the rate.
const BAUD: u32 = 2_000_000;

/// Opens a serial port by its path. Not real-time.
///
/// # Errors
/// [`OpenError`] if the port is missing, in use, or not permitted.
pub fn open(path: &str) -> Result<StreamLink<Port>, OpenError> {
    let mut port = Port::open(path, BAUD).map_err(|reason| refused(path, reason))?;
    port.announce();
    Ok(StreamLink::new(port))
}

fn refused(path: &str, reason: NotOpened) -> OpenError {
    let address = path.to_owned();
    match reason {
        NotOpened::Forbidden { remedy } => OpenError::Forbidden { address, remedy: remedy.to_owned() },
        NotOpened::InUse => OpenError::Busy { address },
        NotOpened::NoPort => {
            OpenError::Missing { address, cause: "the file is not a usable serial port".to_owned() }
        }
        NotOpened::Missing { cause } => OpenError::Missing { address, cause },
    }
}
