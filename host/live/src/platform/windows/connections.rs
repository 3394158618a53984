//! Connections: each client sends the secret first, within a timeout; the host waits for all clients concurrently.
//!
//! One thread reads from all clients without blocking: a client that sends nothing, or single bytes, is rejected after the timeout,
//! and the end of a run waits for no client.

use super::announced::{Announced, SECRET_BYTES};
use flotor_core::lock;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Connection between client and host.
pub(crate) use std::net::TcpStream as Stream;

/// Timeout for sending the whole secret.
const SECRET_WAIT: Duration = Duration::from_secs(1);
/// Maximum number of clients that have not sent the secret; if another connects, the oldest is rejected.
const MAX_PENDING: usize = 16;
/// Poll interval of the clients that have not sent the secret.
const POLL_PERIOD: Duration = Duration::from_millis(2);

/// Listening socket that accepts connections of clients until it is closed.
#[derive(Debug)]
pub(crate) struct Listening {
    socket: TcpListener,
    secret: String,
    is_closed: AtomicBool,
    /// Clients that have not sent the secret; locked by the accepting thread.
    pending: Mutex<Vec<Pending>>,
    /// Open file, which others cannot remove during the run.
    _file: File,
}

/// Client that has not sent the whole secret yet.
#[derive(Debug)]
struct Pending {
    stream: Stream,
    received: [u8; SECRET_BYTES],
    length: usize,
    since: Instant,
}

/// Result of checking the bytes received from a client.
enum Check {
    Incomplete,
    Passed,
    /// Wrong secret, or a timeout.
    Failed,
}

impl Listening {
    /// Binds a port of this machine, and writes port and new secret to the file at `path`.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let socket = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let announced = Announced::new(socket.local_addr()?.port())?;
        let _file = announced.write(path)?;
        let is_closed = AtomicBool::new(false);
        Ok(Self { socket, secret: announced.secret, is_closed, pending: Mutex::default(), _file })
    }

    /// Makes every present and later [`accept`](Self::accept) return `None`.
    pub(crate) fn close(&self) {
        self.is_closed.store(true, Ordering::Relaxed);
        // Wakes the thread that waits; the port belongs to this socket as long as it is open.
        let _ = self.socket.local_addr().and_then(Stream::connect);
    }

    /// Waits for the next client that sends the secret; `None` once closed, `Interrupted` when a client was rejected.
    pub(crate) fn accept(&self) -> io::Result<Option<Stream>> {
        let mut pending = lock(&self.pending);
        loop {
            // Without a pending client, wait for one.
            self.socket.set_nonblocking(!pending.is_empty())?;
            let accepted = self.socket.accept();
            if self.is_closed.load(Ordering::Relaxed) {
                return Ok(None);
            }
            match accepted {
                Ok((stream, _)) => {
                    let is_full = pending.len() >= MAX_PENDING;
                    if is_full {
                        pending.remove(0);
                    }
                    pending.extend(Pending::new(stream));
                    if is_full {
                        return Err(ErrorKind::Interrupted.into());
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(POLL_PERIOD),
                // The client left before it was accepted.
                Err(error) if is_by_client(error.kind()) => return Err(ErrorKind::Interrupted.into()),
                Err(error) => return Err(error),
            }
            let decided =
                pending.iter_mut().enumerate().find_map(|(place, one)| match one.read_secret(&self.secret) {
                    Check::Incomplete => None,
                    check => Some((place, check)),
                });
            if let Some((place, check)) = decided {
                let Pending { stream, .. } = pending.remove(place);
                let is_accepted = matches!(check, Check::Passed)
                    && stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).is_ok();
                return if is_accepted { Ok(Some(stream)) } else { Err(ErrorKind::Interrupted.into()) };
            }
        }
    }
}

/// Connects to the run that has announced its port in the file at `path`, and sends the secret.
pub(crate) fn connect(path: &Path) -> io::Result<Stream> {
    let Announced { port, secret } = Announced::read(path)?;
    let mut stream = Stream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_nodelay(true)?;
    stream.write_all(secret.as_bytes())?;
    Ok(stream)
}

/// Connects as [`connect`] does, and makes the connection non-blocking.
pub(crate) fn connect_now(path: &Path) -> io::Result<Stream> {
    let stream = connect(path)?;
    stream.set_nonblocking(true).map(|()| stream)
}

/// Returns true if the client has closed its end without a request.
pub(crate) fn has_left(stream: &Stream) -> bool {
    let peeked = stream.set_nonblocking(true).and_then(|()| stream.peek(&mut [0; 1]));
    stream.set_nonblocking(false).is_err() || peeked.is_ok_and(|available| available == 0)
}

fn is_by_client(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::Interrupted)
}

impl Pending {
    fn new(stream: Stream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        Some(Self { stream, received: [0; SECRET_BYTES], length: 0, since: Instant::now() })
    }

    /// Reads received bytes up to the length of the secret, and checks them.
    fn read_secret(&mut self, secret: &str) -> Check {
        let rest = self.received.get_mut(self.length..).unwrap_or_default();
        match self.stream.read(rest) {
            Ok(0) => return Check::Failed,
            Ok(length) => self.length += length,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => return Check::Failed,
        }
        match self.length {
            SECRET_BYTES if self.received == *secret.as_bytes() => Check::Passed,
            SECRET_BYTES => Check::Failed,
            _ if self.since.elapsed() > SECRET_WAIT => Check::Failed,
            _ => Check::Incomplete,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Accepts until a client passes; how many were rejected before it.
    fn accept_one(listening: &Listening) -> (Stream, usize) {
        let mut rejected = 0;
        loop {
            match listening.accept() {
                Ok(stream) => return (stream.expect("it is open"), rejected),
                Err(error) => {
                    assert_eq!(error.kind(), ErrorKind::Interrupted);
                    rejected += 1;
                }
            }
        }
    }

    fn without_secret(path: &Path) -> Stream {
        Stream::connect((Ipv4Addr::LOCALHOST, Announced::read(path).unwrap().port)).unwrap()
    }

    #[test]
    fn a_client_with_another_secret_or_none_is_rejected() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut wrong = without_secret(&path);
        wrong.write_all(&[b'0'; SECRET_BYTES]).unwrap();
        drop(without_secret(&path));
        let mut client = connect(&path).unwrap();
        client.write_all(b"and more").unwrap();
        let (mut stream, rejected) = accept_one(&listening);
        assert!(rejected <= 2);
        let mut rest = [0; 8];
        stream.read_exact(&mut rest).unwrap();
        assert_eq!(&rest, b"and more", "what follows the secret is left in the connection");
    }

    #[test]
    fn clients_that_send_it_byte_by_byte_delay_no_other() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut slow: Vec<Stream> = (0..4).map(|_| without_secret(&path)).collect();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for _ in 0..SECRET_BYTES / 2 {
                    for client in &mut slow {
                        let _ = client.write_all(b"0"); // rejected at some point
                    }
                    std::thread::sleep(SECRET_WAIT / 8);
                }
            });
            let clients: Vec<Stream> = (0..4).map(|_| connect(&path).unwrap()).collect();
            let rejected: usize = clients.iter().map(|_| accept_one(&listening).1).sum();
            // All four of them would be, if each was waited for; a busy machine may take the time of some.
            assert!(rejected < 4, "{rejected}");
        });
    }

    #[test]
    fn a_client_that_sends_nothing_is_rejected_in_time() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut silent = without_secret(&path);
        silent.write_all(b"0").unwrap();
        assert_eq!(listening.accept().unwrap_err().kind(), ErrorKind::Interrupted);
        let crowd: Vec<Stream> = (0..=MAX_PENDING).map(|_| without_secret(&path)).collect();
        let client = connect(&path).unwrap();
        let _ = accept_one(&listening);
        drop((crowd, client));
    }
}
