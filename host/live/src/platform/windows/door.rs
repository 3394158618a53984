//! Connections: each client sends the secret first, within a time limit; the host waits for all of them at once.
//!
//! One thread does all of it, and never waits for one of them: whoever says nothing, or one byte now and then, is turned away
//! when its time is over, and the end of a run waits for none of them.

use super::announced::{Announced, SECRET_BYTES};
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A connection.
pub(crate) use std::net::TcpStream as Stream;

/// How long who connects may take to say the whole secret.
const SECRET_WAIT: Duration = Duration::from_secs(1);
/// Most that are listened to at a time; for one more, the one that came first is turned away.
const MOST_ARRIVING: usize = 16;
/// Pause between two looks at those who have not said it yet.
const LOOK_PERIOD: Duration = Duration::from_millis(2);

/// Where connections come in.
#[derive(Clone, Debug)]
pub(crate) struct Listening(Arc<Door>);

#[derive(Debug)]
struct Door {
    socket: TcpListener,
    secret: String,
    /// Whoever accepts has it: one at a time.
    arriving: Mutex<Vec<Arriving>>,
    /// Keeps the file from being removed while the run lives.
    _file: File,
}

/// Who has not said the secret yet.
#[derive(Debug)]
struct Arriving {
    stream: Stream,
    said: [u8; SECRET_BYTES],
    length: usize,
    since: Instant,
}

/// What becomes of one.
enum Said {
    NotAll,
    Secret,
    /// Not the secret, or not in time.
    Nothing,
}

impl Listening {
    /// Takes a port, and writes it with a new secret into a file.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let socket = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let announced = Announced::new(socket.local_addr()?.port())?;
        let _file = announced.write(path)?;
        Ok(Self(Arc::new(Door { socket, secret: announced.secret, arriving: Mutex::default(), _file })))
    }

    /// A second handle.
    #[allow(clippy::unnecessary_wraps)] // elsewhere a system makes it
    pub(crate) fn try_clone(&self) -> io::Result<Self> {
        Ok(self.clone())
    }
}

/// Connects to the run behind a file.
pub(crate) fn connect(path: &Path) -> io::Result<Stream> {
    let Announced { port, secret } = Announced::read(path)?;
    let mut stream = Stream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_nodelay(true)?;
    stream.write_all(secret.as_bytes())?;
    Ok(stream)
}

/// Waits for the next connection that says the secret; `Interrupted` when one was turned away.
pub(crate) fn accept(Listening(door): &Listening) -> io::Result<Stream> {
    let mut arriving = door.arriving.lock().unwrap_or_else(PoisonError::into_inner);
    loop {
        // With nobody there, only a connection can bring anything.
        door.socket.set_nonblocking(!arriving.is_empty())?;
        match door.socket.accept() {
            Ok((stream, _)) => {
                let is_full = arriving.len() >= MOST_ARRIVING;
                if is_full {
                    arriving.remove(0);
                }
                arriving.extend(Arriving::new(stream));
                if is_full {
                    return Err(ErrorKind::Interrupted.into());
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(LOOK_PERIOD),
            // It went before it was taken.
            Err(error) if is_of_the_other(error.kind()) => return Err(ErrorKind::Interrupted.into()),
            Err(error) => return Err(error),
        }
        let decided =
            arriving.iter_mut().enumerate().find_map(|(place, one)| match one.listen(&door.secret) {
                Said::NotAll => None,
                said => Some((place, said)),
            });
        if let Some((place, said)) = decided {
            let Arriving { stream, .. } = arriving.remove(place);
            let is_let_in = matches!(said, Said::Secret)
                && stream.set_nonblocking(false).and_then(|()| stream.set_nodelay(true)).is_ok();
            return if is_let_in { Ok(stream) } else { Err(ErrorKind::Interrupted.into()) };
        }
    }
}

fn is_of_the_other(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::Interrupted)
}

impl Arriving {
    fn new(stream: Stream) -> Option<Self> {
        stream.set_nonblocking(true).ok()?;
        Some(Self { stream, said: [0; SECRET_BYTES], length: 0, since: Instant::now() })
    }

    /// Reads what is there, and no byte beyond the secret.
    fn listen(&mut self, secret: &str) -> Said {
        let rest = self.said.get_mut(self.length..).unwrap_or_default();
        match self.stream.read(rest) {
            Ok(0) => return Said::Nothing,
            Ok(length) => self.length += length,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => return Said::Nothing,
        }
        match self.length {
            SECRET_BYTES if self.said == *secret.as_bytes() => Said::Secret,
            SECRET_BYTES => Said::Nothing,
            _ if self.since.elapsed() > SECRET_WAIT => Said::Nothing,
            _ => Said::NotAll,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Accepts until there is a connection; how many were turned away before it.
    fn let_in(listening: &Listening) -> (Stream, usize) {
        let mut turned_away = 0;
        loop {
            match accept(listening) {
                Ok(stream) => return (stream, turned_away),
                Err(error) => {
                    assert_eq!(error.kind(), ErrorKind::Interrupted);
                    turned_away += 1;
                }
            }
        }
    }

    fn stranger(path: &Path) -> Stream {
        Stream::connect((Ipv4Addr::LOCALHOST, Announced::read(path).unwrap().port)).unwrap()
    }

    #[test]
    fn who_says_another_secret_or_none_is_turned_away() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut wrong = stranger(&path);
        wrong.write_all(&[b'0'; SECRET_BYTES]).unwrap();
        drop(stranger(&path));
        let mut client = connect(&path).unwrap();
        client.write_all(b"and more").unwrap();
        let (mut stream, turned_away) = let_in(&listening);
        assert!(turned_away <= 2);
        let mut heard = [0; 8];
        stream.read_exact(&mut heard).unwrap();
        assert_eq!(&heard, b"and more", "what follows the secret is left in the connection");
    }

    #[test]
    fn strangers_that_say_it_byte_by_byte_delay_nobody() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut strangers: Vec<Stream> = (0..4).map(|_| stranger(&path)).collect();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for _ in 0..SECRET_BYTES / 2 {
                    for stranger in &mut strangers {
                        let _ = stranger.write_all(b"0"); // turned away some time
                    }
                    std::thread::sleep(SECRET_WAIT / 8);
                }
            });
            let clients: Vec<Stream> = (0..4).map(|_| connect(&path).unwrap()).collect();
            let turned_away: usize = clients.iter().map(|_| let_in(&listening).1).sum();
            // All four of them would be, if each was waited for; a busy machine may take the time of some.
            assert!(turned_away < 4, "{turned_away}");
        });
    }

    #[test]
    fn one_that_says_nothing_has_its_time_and_no_more() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let listening = Listening::bind(&path).unwrap();
        let mut silent = stranger(&path);
        silent.write_all(b"0").unwrap();
        assert_eq!(accept(&listening).unwrap_err().kind(), ErrorKind::Interrupted);
        let crowd: Vec<Stream> = (0..=MOST_ARRIVING).map(|_| stranger(&path)).collect();
        let client = connect(&path).unwrap();
        let _ = let_in(&listening);
        drop((crowd, client));
    }
}
