//! Datagrams between two programs of this user, over UDP within this machine.

use super::announced::Announced;
use flotor_core::lock;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Sender of a datagram.
#[derive(Debug)]
pub(crate) struct Address(PathBuf);

impl Address {
    /// Returns the path of the sender's file, as given in the datagram.
    #[allow(clippy::unnecessary_wraps)] // elsewhere a socket may have none
    pub(crate) fn as_pathname(&self) -> Option<&Path> {
        Some(&self.0)
    }
}

/// Datagram socket with a file that announces its port and secret. A datagram consists of the receiver's secret, the length of the
/// path of the sender's file (2 bytes), the path, and the payload.
#[derive(Debug)]
pub(crate) struct Datagrams {
    socket: UdpSocket,
    secret: String,
    path: String,
    /// Cached contents of the files of other sockets.
    known: Mutex<Vec<Known>>,
    /// Open file, which others cannot remove while the socket is open.
    _file: File,
}

/// Cached content of the file of another socket.
#[derive(Debug)]
struct Known {
    path: PathBuf,
    announced: Announced,
    seen: Instant,
}

/// Lifetime of a cached content: a socket recreated under the same path misses the datagrams of this time.
const LOOK_PERIOD: Duration = Duration::from_millis(10);
/// Maximum length of a datagram, bytes: longer datagrams are discarded.
const LONGEST: usize = 8 * 1024;
/// Error code of a datagram that is too long (`WSAEMSGSIZE`); its rest is lost.
const TOO_LONG: i32 = 10040;
/// Maximum number of datagrams discarded in one call, which limits the delay by a flood.
const MAX_DISCARDED: usize = 64;

impl Datagrams {
    /// Binds a non-blocking socket to a port of this machine, and writes port and new secret to the file at `path`.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.set_nonblocking(true)?;
        let announced = Announced::new(socket.local_addr()?.port())?;
        let _file = announced.write(path)?;
        let path = path
            .to_str()
            .ok_or_else(|| io::Error::other("the name of the socket is not valid Unicode"))?
            .to_owned();
        Ok(Self { socket, secret: announced.secret, path, known: Mutex::default(), _file })
    }

    /// Sends a datagram to the socket with this path.
    pub(crate) fn send_to(&self, bytes: &[u8], path: &Path) -> io::Result<usize> {
        let mut known = lock(&self.known);
        let place = known.iter().position(|known| known.path == path);
        // An empty datagram (subscription) always reads the file, to check that the other socket exists; states are sent often, and
        // reading a file takes time.
        let is_trusted = |known: &Known| !bytes.is_empty() && known.seen.elapsed() < LOOK_PERIOD;
        let place = match place.filter(|place| known.get(*place).is_some_and(is_trusted)) {
            Some(place) => place,
            None => {
                known.retain(|known| known.path != path);
                let announced = Announced::read(path)?;
                known.push(Known { path: path.to_path_buf(), announced, seen: Instant::now() });
                known.len() - 1
            }
        };
        let Some(Known { announced: Announced { port, secret }, .. }) = known.get(place) else {
            return Err(ErrorKind::NotFound.into());
        };
        let length = u16::try_from(self.path.len()).map_err(io::Error::other)?.to_le_bytes();
        let datagram = [secret.as_bytes(), &length, self.path.as_bytes(), bytes].concat();
        self.socket.send_to(&datagram, (Ipv4Addr::LOCALHOST, *port))
    }

    /// Receives the next datagram; returns its length and sender. `WouldBlock` if no datagram is pending, or after
    /// [`MAX_DISCARDED`] discarded datagrams.
    pub(crate) fn recv_from(&self, buffer: &mut [u8]) -> io::Result<(usize, Address)> {
        let mut datagram = [0; LONGEST];
        for _ in 0..MAX_DISCARDED {
            let length = match self.socket.recv_from(&mut datagram) {
                Ok((length, _)) => length,
                Err(error) if error.raw_os_error() == Some(TOO_LONG) => continue,
                // An earlier datagram did not arrive: its socket is closed, or was recreated.
                Err(error) if error.kind() == ErrorKind::ConnectionReset => {
                    lock(&self.known).clear();
                    continue;
                }
                Err(error) => return Err(error),
            };
            // Datagrams without the secret are ignored.
            let Some((path, sent)) = datagram.get(..length).and_then(|said| self.read(said)) else {
                continue;
            };
            let length = sent.len().min(buffer.len());
            buffer.iter_mut().zip(sent).for_each(|(place, byte)| *place = *byte);
            return Ok((length, Address(path)));
        }
        Err(ErrorKind::WouldBlock.into())
    }

    fn read<'a>(&self, datagram: &'a [u8]) -> Option<(PathBuf, &'a [u8])> {
        let rest = datagram.strip_prefix(self.secret.as_bytes())?;
        let (length, rest) = rest.split_first_chunk()?;
        let (path, sent) = rest.split_at_checked(u16::from_le_bytes(*length).into())?;
        Some((std::str::from_utf8(path).ok()?.into(), sent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(scratch: &Path) -> [Datagrams; 2] {
        ["host", "guest"].map(|name| Datagrams::bind(&scratch.join(name)).unwrap())
    }

    /// The next that comes, or none in a second.
    fn next(socket: &Datagrams) -> Option<Vec<u8>> {
        let mut buffer = [0; 64];
        let tries = (0..1000).map(|_| {
            std::thread::sleep(Duration::from_millis(1));
            socket.recv_from(&mut buffer).map(|(length, _)| buffer[..length].to_vec())
        });
        tries.filter_map(Result::ok).next()
    }

    #[test]
    fn a_datagram_that_is_too_long_is_discarded_and_the_next_is_read() {
        let scratch = tempfile::tempdir().unwrap();
        let [host, guest] = pair(scratch.path());
        guest.send_to(&[7; LONGEST], &scratch.path().join("host")).unwrap();
        guest.send_to(b"short", &scratch.path().join("host")).unwrap();
        // At the first look that finds any: what comes after a long one does not wait for another look.
        assert_eq!(next(&host).as_deref(), Some(&b"short"[..]));
    }

    #[test]
    fn a_flood_of_strangers_is_left_after_a_while() {
        let scratch = tempfile::tempdir().unwrap();
        let [host, guest] = pair(scratch.path());
        let port = host.socket.local_addr().unwrap();
        let stranger = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        for _ in 0..MAX_DISCARDED {
            stranger.send_to(&[b'0'; 64], port).unwrap();
        }
        guest.send_to(b"known", &scratch.path().join("host")).unwrap();
        std::thread::sleep(Duration::from_millis(100));
        let mut buffer = [0; 64];
        assert_eq!(host.recv_from(&mut buffer).unwrap_err().kind(), ErrorKind::WouldBlock);
        assert_eq!(next(&host).as_deref(), Some(&b"known"[..]));
    }

    #[test]
    fn a_socket_made_anew_under_the_same_path_is_found() {
        let scratch = tempfile::tempdir().unwrap();
        let [host, guest] = pair(scratch.path());
        let path = scratch.path().join("host");
        guest.send_to(b"first", &path).unwrap();
        assert_eq!(next(&host).as_deref(), Some(&b"first"[..]));
        drop(host);
        let host = Datagrams::bind(&path).unwrap();
        std::thread::sleep(LOOK_PERIOD);
        guest.send_to(b"second", &path).unwrap();
        assert_eq!(next(&host).as_deref(), Some(&b"second"[..]));
    }
}
