//! TCP: controllers on a network, and emulators in another process.

use super::OpenError;
use super::stream::StreamLink;
use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// TCP port of a controller with Flotor's own protocol; the ML API has port 5678.
pub const PORT: u16 = 5679;
/// Timeout of a connection attempt.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

/// Opens a link to `host:port`. Not real-time.
///
/// # Errors
/// [`OpenError`] if the address is invalid or the connection fails.
pub fn connect(address: &str) -> Result<StreamLink<TcpStream>, OpenError> {
    open(address).map(StreamLink::new)
}

/// Opens a non-blocking connection to `host:port` without Nagle's algorithm. Not real-time.
///
/// # Errors
/// [`OpenError`] if the address is invalid or the connection fails.
pub fn open(address: &str) -> Result<TcpStream, OpenError> {
    let wrong =
        || OpenError::Address { address: address.to_owned(), expected: "host:port, like 127.0.0.1:5679" };
    let found = address.to_socket_addrs().map_err(|error| match (error.kind(), address.rsplit_once(':')) {
        (ErrorKind::InvalidInput, _) | (_, None) => wrong(),
        (_, Some((host, _))) => OpenError::UnknownHost { host: host.to_owned() },
    });
    let target = found?.next().ok_or_else(wrong)?;
    let stream = TcpStream::connect_timeout(&target, CONNECT_TIMEOUT);
    stream.and_then(prepared).map_err(|error| match error.kind() {
        ErrorKind::PermissionDenied => OpenError::Forbidden {
            address: address.to_owned(),
            remedy: "allow the connection in the firewall or the sandbox".to_owned(),
        },
        _ => OpenError::Missing { address: address.to_owned(), cause: error.to_string() },
    })
}

/// Makes a connection non-blocking and disables Nagle's algorithm.
///
/// # Errors
/// Errors of the system when setting the options.
pub fn prepared(stream: TcpStream) -> std::io::Result<TcpStream> {
    stream.set_nodelay(true)?;
    stream.set_nonblocking(true)?;
    Ok(stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_host_is_no_malformed_address() {
        // No name has a part of 64 letters: nobody is asked for it.
        let host = "n".repeat(64);
        let told = |address: &str| connect(address).err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(
            told(&format!("{host}:1")),
            format!("unknown host `{host}` (`address`); check the name or use the IP address")
        );
        for malformed in ["here", "127.0.0.1:port", ""] {
            assert!(
                told(malformed).ends_with("is not valid; write host:port, like 127.0.0.1:5679"),
                "{}",
                told(malformed)
            );
        }
    }
}
