//! Connections of a port with two protocols: a connection begins with the head of an HTTP request, which may request an upgrade
//! to WebSocket. The [`crate::channels`] serve the connections.

use crate::access::Access;
use flotor_emulation::port::Port;
use serde_json::{Value, json};
use std::io::{self, Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tungstenite::handshake::derive_accept_key;

/// Timeout of a whole request, and of each write of a reply.
pub(crate) const PATIENCE: Duration = Duration::from_secs(5);
/// Limit on the connections of a port, each with a thread; further connections are closed at once.
const MOST_CONNECTIONS: usize = 30;
/// Limits on head and body of a request, bytes.
const LONGEST_HEAD: usize = 16 << 10;
const LONGEST_BODY: usize = 64 << 10;
/// Pause after a failed accept: there may be no descriptor left.
const PAUSE: Duration = Duration::from_millis(50);

/// HTTP request.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// Path and query.
    pub(crate) target: String,
    pub(crate) body: String,
}

/// Parsed head of a request, and the bytes received after it.
#[derive(Debug, Default)]
pub(crate) struct Head {
    pub(crate) request: Request,
    /// `Sec-WebSocket-Key` of a request for an upgrade; `None` for any other request.
    key: Option<String>,
    /// `Origin`: site of the web page that opened the connection.
    origin: Option<String>,
    /// `Host`: name of this machine used by the client.
    host: Option<String>,
    length: usize,
    /// Bytes received after the head.
    pub(crate) rest: Vec<u8>,
}

/// Accepts connections in a thread, and serves each in a thread of its own.
///
/// # Errors
/// If the accepting thread cannot be created.
pub(crate) fn accept(
    port: Port,
    name: &str,
    serve: impl Fn(TcpStream) -> io::Result<()> + Copy + Send + 'static,
) -> io::Result<()> {
    let accept = move || {
        // Reference count of the connections.
        let served = Arc::new(());
        loop {
            let Ok(stream) = port.accept() else {
                std::thread::sleep(PAUSE);
                continue;
            };
            if Arc::strong_count(&served) > MOST_CONNECTIONS {
                continue;
            }
            let place = Arc::clone(&served);
            let thread = std::thread::Builder::new().name("flotor-client".to_owned());
            // Without a thread the connection is closed; a client that disconnects while it is served is not an error.
            let _ = thread.spawn(move || {
                let _place = place;
                serve(stream)
            });
        }
    };
    std::thread::Builder::new().name(name.to_owned()).spawn(accept)?;
    Ok(())
}

/// Reads the head of a request, and answers 403 if access is denied. `None` if there is nothing to serve: access denied, head
/// malformed or too long, or connection closed.
pub(crate) fn prepared(
    stream: &mut TcpStream,
    access: &Access,
    deadline: Instant,
) -> io::Result<Option<Head>> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut bytes = Vec::new();
    while bytes.len() < LONGEST_HEAD && read_more(stream, deadline, &mut bytes)? > 0 {
        if let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") {
            let rest = bytes.split_off(end + 4);
            let Some(head) = Head::read(&String::from_utf8_lossy(&bytes), rest) else { return Ok(None) };
            return match access.check(head.origin.as_deref(), head.host.as_deref()) {
                Ok(()) => Ok(Some(head)),
                Err(forbidden) => {
                    answer(stream, &failed(403, &forbidden.to_string()))?;
                    Ok(None)
                }
            };
        }
    }
    Ok(None)
}

/// Waits for bytes until a deadline, and appends them; returns their number, 0 at the end of the connection.
fn read_more(stream: &mut TcpStream, deadline: Instant, bytes: &mut Vec<u8>) -> io::Result<usize> {
    let remaining = deadline.saturating_duration_since(Instant::now());
    if remaining.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    stream.set_read_timeout(Some(remaining))?;
    let mut buffer = [0; 2048];
    let count = stream.read(&mut buffer)?;
    bytes.extend_from_slice(buffer.get(..count).unwrap_or_default());
    Ok(count)
}

/// Completes a WebSocket upgrade; returns false if the client requested no upgrade.
pub(crate) fn upgraded(stream: &mut TcpStream, head: &Head) -> io::Result<bool> {
    let Some(key) = &head.key else { return Ok(false) };
    let accept = derive_accept_key(key.as_bytes());
    write!(
        stream,
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    )?;
    stream.set_read_timeout(None)?;
    Ok(true)
}

/// Reads the body of a request, at most 64 KiB.
pub(crate) fn read_body(stream: &mut TcpStream, head: &mut Head, deadline: Instant) -> io::Result<()> {
    let length = head.length.min(LONGEST_BODY);
    let mut body = std::mem::take(&mut head.rest);
    while body.len() < length && read_more(stream, deadline, &mut body)? > 0 {}
    body.truncate(length);
    head.request.body = String::from_utf8_lossy(&body).into_owned();
    Ok(())
}

/// Reply to a request: status and JSON.
pub(crate) type Answer = (u16, Value);

/// Returns the reply to a request that failed.
pub(crate) fn failed(status: u16, why: &str) -> Answer {
    (status, json!({ "ok": false, "error": why }))
}

/// Writes the complete response to a request.
pub(crate) fn answer(stream: &mut TcpStream, (status, body): &Answer) -> io::Result<()> {
    let reason = if *status == 200 { "OK" } else { "Error" };
    let text = body.to_string();
    let length = text.len();
    let response = format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{text}"
    );
    stream.write_all(response.as_bytes())
}

impl Head {
    fn read(text: &str, rest: Vec<u8>) -> Option<Self> {
        let mut lines = text.split("\r\n");
        let mut words = lines.next()?.split(' ');
        let request = Request {
            method: words.next()?.to_owned(),
            target: words.next()?.to_owned(),
            body: String::new(),
        };
        let mut head = Self { request, rest, ..Self::default() };
        let (mut wants_socket, mut key) = (false, None);
        for (name, value) in lines.filter_map(|line| line.split_once(':')) {
            let value = value.trim();
            match name.trim().to_ascii_lowercase().as_str() {
                "upgrade" => wants_socket = value.eq_ignore_ascii_case("websocket"),
                "sec-websocket-key" => key = Some(value.to_owned()),
                "origin" => head.origin = Some(value.to_owned()),
                "host" => head.host = Some(value.to_owned()),
                "content-length" => head.length = value.parse().unwrap_or(0),
                _ => {}
            }
        }
        head.key = key.filter(|_| wants_socket);
        Some(head)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_and_a_websocket_are_distinguished_by_their_first_lines() {
        let plain =
            Head::read("POST /sessions/1/profile HTTP/1.1\r\nHost: x\r\nContent-Length: 12\r\n", Vec::new());
        let plain = plain.expect("it is a request");
        assert_eq!(
            (plain.request.method.as_str(), plain.request.target.as_str()),
            ("POST", "/sessions/1/profile")
        );
        assert_eq!((plain.key, plain.length), (None, 12));
        let socket = "GET / HTTP/1.1\r\nupgrade: WebSocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZQ==\r\n";
        assert_eq!(
            Head::read(socket, Vec::new()).and_then(|head| head.key).as_deref(),
            Some("dGhlIHNhbXBsZQ==")
        );
        assert!(Head::read("malformed", Vec::new()).is_none());
    }
}
