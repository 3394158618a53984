//! Connections of both kinds: their end, and frames to their clients.

use std::io::{ErrorKind, Write};
use std::net::TcpStream;

/// Returns true if the connection is closed by the other end, or broken.
pub(super) fn is_gone(stream: &TcpStream) -> bool {
    let looked = stream.set_nonblocking(true).and_then(|()| stream.peek(&mut [0]));
    let gone = match looked {
        Ok(length) => length == 0,
        Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
    };
    gone || stream.set_nonblocking(false).is_err()
}

/// Sends a frame in a single write; returns false if the connection is lost or the write times out.
pub(super) fn send(stream: &mut TcpStream, bytes: &[u8]) -> bool {
    stream.write_all(bytes).is_ok()
}
