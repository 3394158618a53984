//! Windows: a port of this machine alone and a secret, both in a file of the user's profile.
//!
//! Whoever can read the file may watch and change the run: by the rights of the profile that is its user, and administrators.

use std::fs::{File, Metadata, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, UdpSocket};
use std::os::windows::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A connection.
pub(crate) use std::net::TcpStream as Stream;

/// Others may read the file, and neither write nor remove it (`FILE_SHARE_READ`).
const SHARE_READ: u32 = 1;
/// `FILE_FLAG_DELETE_ON_CLOSE`: the file goes with the process, however that ends.
const REMOVE_AT_END: u32 = 0x0400_0000;
/// Bytes of a secret, which is written in digits.
const SECRET_BYTES: usize = 32;
/// How long who connects may take to say the secret.
const SECRET_WAIT: Duration = Duration::from_millis(200);

/// The folder of the runs of this user.
pub(crate) fn run_folder() -> PathBuf {
    let local = std::env::var_os("LOCALAPPDATA").map(PathBuf::from).filter(|path| path.is_absolute());
    local.unwrap_or_else(std::env::temp_dir).join("flotor").join("run")
}

/// Makes a folder, if it is not there. It has the rights of the one above it: in a profile, those of its user.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    std::fs::create_dir_all(path)
}

/// Whether this is a folder, and no link to one.
pub(crate) fn is_ours(attributes: &Metadata) -> bool {
    attributes.is_dir()
}

/// The same: the rights of a folder are not looked at.
pub(crate) fn is_ours_alone(attributes: &Metadata) -> bool {
    is_ours(attributes)
}

/// A file has the rights of its folder.
pub(crate) fn private_file(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Removes the file of a run whose process is no more; true if that is so. The file of one that lives cannot be removed.
pub(crate) fn remove_if_over(path: &Path, _: u32) -> bool {
    std::fs::remove_file(path).is_ok() || !path.exists()
}

/// Where connections come in.
#[derive(Debug)]
pub(crate) struct Listening {
    socket: TcpListener,
    secret: String,
    /// Keeps the file from being removed while the run lives.
    file: Arc<File>,
}

impl Listening {
    /// Takes a port, and writes it with a new secret into a file.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let socket = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let secret = secret();
        let file = announce(path, socket.local_addr()?.port(), &secret)?;
        Ok(Self { socket, secret, file: Arc::new(file) })
    }

    /// A second handle.
    pub(crate) fn try_clone(&self) -> io::Result<Self> {
        let socket = self.socket.try_clone()?;
        Ok(Self { socket, secret: self.secret.clone(), file: Arc::clone(&self.file) })
    }
}

/// Writes port and secret into a file that stays until what is returned is closed.
fn announce(path: &Path, port: u16, secret: &str) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true).share_mode(SHARE_READ).custom_flags(REMOVE_AT_END);
    let mut file = options.open(path)?;
    write!(file, "{port} {secret}")?;
    Ok(file)
}

/// Port and secret of a file.
fn announced(path: &Path) -> io::Result<(u16, String)> {
    let text = std::fs::read_to_string(path)?;
    let read = text.split_once(' ').and_then(|(port, secret)| Some((port.parse().ok()?, secret.to_owned())));
    read.ok_or_else(|| io::Error::new(ErrorKind::InvalidData, "its file names no port"))
}

/// 128 random bits of the system: the keys of the standard library's hash maps, and what they make of two numbers.
fn secret() -> String {
    let half = |number: u64| {
        let mut hasher = RandomState::new().build_hasher();
        hasher.write_u64(number);
        hasher.finish()
    };
    format!("{:016x}{:016x}", half(0), half(1))
}

/// Connects to the run behind a file.
pub(crate) fn connect(path: &Path) -> io::Result<Stream> {
    let (port, secret) = announced(path)?;
    let mut stream = Stream::connect((Ipv4Addr::LOCALHOST, port))?;
    stream.set_nodelay(true)?;
    stream.write_all(secret.as_bytes())?;
    Ok(stream)
}

/// Waits for the next connection. Who does not know the secret is no connection.
pub(crate) fn accept(listening: &Listening) -> io::Result<Stream> {
    let (mut stream, _) = listening.socket.accept()?;
    let turned_away = |_| io::Error::from(ErrorKind::Interrupted);
    let mut said = [0; SECRET_BYTES];
    stream.set_read_timeout(Some(SECRET_WAIT)).map_err(turned_away)?;
    stream.read_exact(&mut said).map_err(turned_away)?;
    if said != *listening.secret.as_bytes() {
        return Err(ErrorKind::Interrupted.into());
    }
    stream.set_read_timeout(None).and_then(|()| stream.set_nodelay(true)).map_err(turned_away)?;
    Ok(stream)
}

/// Where a datagram comes from.
#[derive(Debug)]
pub(crate) struct Address(PathBuf);

impl Address {
    /// Its file, as that socket says.
    #[allow(clippy::unnecessary_wraps)] // elsewhere a socket may have none
    pub(crate) fn as_pathname(&self) -> Option<&Path> {
        Some(&self.0)
    }
}

/// A socket for datagrams, whose file names its port and its secret. A datagram is the receiver's secret, the length of the
/// name of the sender's file (2 bytes), that name, and what is sent.
#[derive(Debug)]
pub(crate) struct Datagrams {
    socket: UdpSocket,
    secret: String,
    path: String,
    /// Others, by their files.
    known: Mutex<Vec<Known>>,
    /// Keeps the file from being removed while the socket is there.
    _file: File,
}

/// What the file of another says.
#[derive(Debug)]
struct Known {
    path: PathBuf,
    port: u16,
    secret: String,
    seen: Instant,
}

/// How long what a file says is believed.
const LOOK_PERIOD: Duration = Duration::from_millis(10);
/// Longest datagram, bytes: what is longer is cut, as by a system's socket.
const LONGEST: usize = 8 * 1024;

impl Datagrams {
    /// Makes it. It waits for nothing, both ways.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.set_nonblocking(true)?;
        let secret = secret();
        let file = announce(path, socket.local_addr()?.port(), &secret)?;
        let path = path.to_str().ok_or_else(|| io::Error::other("its name is no text"))?.to_owned();
        Ok(Self { socket, secret, path, known: Mutex::default(), _file: file })
    }

    /// Sends to the socket of another name.
    pub(crate) fn send_to(&self, bytes: &[u8], path: &Path) -> io::Result<usize> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let place = known.iter().position(|known| known.path == path);
        // A call asks whether the other is there; states are sent often, and a look at a file takes its time.
        let is_trusted = |known: &Known| !bytes.is_empty() && known.seen.elapsed() < LOOK_PERIOD;
        let place = match place.filter(|place| known.get(*place).is_some_and(is_trusted)) {
            Some(place) => place,
            None => {
                known.retain(|known| known.path != path);
                let (port, secret) = announced(path)?;
                known.push(Known { path: path.to_path_buf(), port, secret, seen: Instant::now() });
                known.len() - 1
            }
        };
        let Some(Known { port, secret, .. }) = known.get(place) else {
            return Err(ErrorKind::NotFound.into());
        };
        let length = u16::try_from(self.path.len()).map_err(io::Error::other)?.to_le_bytes();
        let datagram = [secret.as_bytes(), &length, self.path.as_bytes(), bytes].concat();
        self.socket.send_to(&datagram, (Ipv4Addr::LOCALHOST, *port))
    }

    /// The next datagram: its length, and where it comes from.
    pub(crate) fn recv_from(&self, buffer: &mut [u8]) -> io::Result<(usize, Address)> {
        let mut datagram = [0; LONGEST];
        loop {
            let length = match self.socket.recv_from(&mut datagram) {
                Ok((length, _)) => length,
                // One that was sent before found nobody.
                Err(error) if error.kind() == ErrorKind::ConnectionReset => continue,
                Err(error) => return Err(error),
            };
            // Who does not know the secret says nothing.
            let Some((path, sent)) = datagram.get(..length).and_then(|said| self.read(said)) else {
                continue;
            };
            let length = sent.len().min(buffer.len());
            buffer.iter_mut().zip(sent).for_each(|(place, byte)| *place = *byte);
            return Ok((length, Address(path)));
        }
    }

    fn read<'a>(&self, datagram: &'a [u8]) -> Option<(PathBuf, &'a [u8])> {
        let rest = datagram.strip_prefix(self.secret.as_bytes())?;
        let (length, rest) = rest.split_first_chunk()?;
        let (path, sent) = rest.split_at_checked(u16::from_le_bytes(*length).into())?;
        Some((std::str::from_utf8(path).ok()?.into(), sent))
    }
}
