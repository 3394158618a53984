//! Unix: Unix domain sockets and permissions.

use flotor_core::lock;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::net::{AddressFamily, RecvFlags, SocketAddrUnix, SocketType, recv};
use rustix::process::getuid;
use std::fs::{DirBuilder, File, Metadata, OpenOptions};
use std::io::{self, ErrorKind};
use std::net::Shutdown;
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Sender of a datagram.
pub(crate) use std::os::unix::net::SocketAddr as Address;
use std::os::unix::net::UnixListener;
/// Connection between client and host.
pub(crate) use std::os::unix::net::UnixStream as Stream;

/// Permissions of a folder that only its owner may enter.
const PRIVATE: u32 = 0o700;

/// Returns the folder for the runs of this user if `XDG_RUNTIME_DIR` is not a folder.
pub(crate) fn run_folder() -> PathBuf {
    std::env::temp_dir().join(format!("flotor-{}", getuid().as_raw()))
}

/// Returns true if the process, or the system, has no descriptor left.
pub(crate) fn is_out_of_descriptors(cause: &io::Error) -> bool {
    matches!(Errno::from_io_error(cause), Some(Errno::MFILE | Errno::NFILE))
}

/// Creates a folder that only this user may enter, if necessary.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(PRIVATE).create(path)
}

/// Returns true for a folder that this user owns.
pub(crate) fn is_ours(attributes: &Metadata) -> bool {
    attributes.is_dir() && attributes.uid() == getuid().as_raw()
}

/// Returns true for a folder that only this user may enter.
pub(crate) fn is_ours_alone(attributes: &Metadata) -> bool {
    is_ours(attributes) && attributes.mode() & 0o077 == 0
}

/// Restricts the permissions of a new file to this user.
pub(crate) fn private_file(options: &mut OpenOptions) -> &mut OpenOptions {
    options.mode(0o600)
}

/// Removes the socket file and returns true if no process has the socket open; else returns false. The process id is not checked:
/// containers that share the folder have separate process ids.
pub(crate) fn remove_if_dead(path: &Path) -> bool {
    // Probe with a datagram socket: if no process has the socket file open, the connection is refused, whatever the
    // type of the socket. A listening stream socket reports another error and accepts no connection.
    let probed = UnixDatagram::unbound().and_then(|probe| probe.connect(path));
    let is_dead = probed.is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused);
    if is_dead {
        let _ = std::fs::remove_file(path); // another process may have been faster
    }
    is_dead
}

/// Reads from an offset of a file; `bytes` beyond the end of the file are not changed.
pub(crate) fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
    FileExt::read_at(file, bytes, offset)
}

/// Overwrites bytes at an offset of a file.
pub(crate) fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    FileExt::write_all_at(file, bytes, offset)
}

/// Returns true if both belong to the same file.
pub(crate) fn is_same_file(one: &Metadata, other: &Metadata) -> bool {
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

/// Connects to the run with this socket file.
pub(crate) fn connect(path: &Path) -> io::Result<Stream> {
    Stream::connect(path)
}

/// Connects without waiting if the run does not accept the connection now; the connection is non-blocking.
pub(crate) fn connect_now(path: &Path) -> io::Result<Stream> {
    let socket = rustix::net::socket(AddressFamily::UNIX, SocketType::STREAM, None)?;
    let stream = Stream::from(socket);
    stream.set_nonblocking(true)?;
    rustix::net::connect(&stream, &SocketAddrUnix::new(path)?)?;
    Ok(stream)
}

/// Listening socket that accepts connections of clients until it is closed.
#[derive(Debug)]
pub(crate) struct Listening {
    socket: UnixListener,
    /// End of a socket pair, which becomes readable on [`close`](Self::close).
    closed: Stream,
    close: Stream,
    /// Descriptor reserved for accepting a client if the process has no free descriptor.
    spare: Mutex<Option<UnixListener>>,
}

impl Listening {
    /// Creates the socket and its file.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        let (closed, close) = Stream::pair()?;
        let socket = UnixListener::bind(path)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, closed, close, spare: Mutex::default() })
    }

    /// Makes every present and later [`accept`](Self::accept) return `None`.
    pub(crate) fn close(&self) {
        let _ = self.close.shutdown(Shutdown::Both);
    }

    /// Waits for the next client; `None` once closed.
    pub(crate) fn accept(&self) -> io::Result<Option<Stream>> {
        let mut spare = lock(&self.spare);
        if spare.is_none() {
            *spare = self.socket.try_clone().ok();
        }
        loop {
            let mut ready =
                [PollFd::new(&self.closed, PollFlags::IN), PollFd::new(&self.socket, PollFlags::IN)];
            poll(&mut ready, None)?;
            if !ready[0].revents().is_empty() {
                return Ok(None);
            }
            match self.socket.accept() {
                Ok((stream, _)) => return stream.set_nonblocking(false).map(|()| Some(stream)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                // Retries with the descriptor that was reserved.
                Err(_) if spare.take().is_some() => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Returns true if the client has closed its end without a request.
pub(crate) fn has_left(stream: &Stream) -> bool {
    let peeked = recv(stream, &mut [0; 1], RecvFlags::PEEK | RecvFlags::DONTWAIT);
    peeked.is_ok_and(|(_, available)| available == 0)
}

/// Datagram socket bound to a file name.
#[derive(Debug)]
pub(crate) struct Datagrams(UnixDatagram);

impl Datagrams {
    /// Creates a non-blocking socket: the shortest timeout of the system is some milliseconds.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        UnixDatagram::bind(path).and_then(|socket| socket.set_nonblocking(true).map(|()| Self(socket)))
    }

    /// Sends a datagram to the socket with this path.
    pub(crate) fn send_to(&self, bytes: &[u8], path: &Path) -> io::Result<usize> {
        self.0.send_to(bytes, path)
    }

    /// Receives the next datagram; returns its length and sender.
    pub(crate) fn recv_from(&self, buffer: &mut [u8]) -> io::Result<(usize, Address)> {
        self.0.recv_from(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Directory, DirectoryError};
    use std::os::unix::fs::PermissionsExt;
    use std::path::PathBuf;

    #[test]
    fn a_process_without_descriptors_is_told_to_allow_more() {
        let cause = rustix::io::Errno::MFILE.into();
        let error = DirectoryError::Unusable { path: PathBuf::from("/run"), cause };
        assert!(error.to_string().contains("ulimit -n"), "{error}");
    }

    /// Two containers with one folder: each run is process 1 of its own, and no process of the other exists.
    #[test]
    fn a_socket_lives_as_long_as_a_process_has_it_open_whatever_its_number() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path());
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let of_no_process = scratch.path().join(format!("{}-0.run", child.id()));
        let of_this_process = scratch.path().join(format!("{}-7.run", std::process::id()));
        let alive = UnixListener::bind(&of_no_process).unwrap();
        drop(UnixListener::bind(&of_this_process).unwrap());
        let found = || directory.runs().into_iter().map(|run| run.path).collect::<Vec<PathBuf>>();
        assert_eq!(found(), [of_no_process.as_path()]);
        assert!(!of_this_process.exists());
        drop(alive);
        assert!(found().is_empty() && !of_no_process.exists());
    }

    #[test]
    fn a_run_takes_no_socket_away_from_another_of_its_number() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let other = directory.listen().unwrap();
        let next = |number: u32| scratch.path().join(format!("runs/{}-{number}.run", std::process::id()));
        let name = other.path().file_stem().unwrap().to_str().unwrap().to_owned();
        let number: u32 = name.split_once('-').unwrap().1.parse().unwrap();
        let of_another: Vec<_> =
            (number + 1..number + 40).map(|n| UnixListener::bind(next(n)).unwrap()).collect();
        let listener = directory.listen().unwrap();
        assert_eq!(directory.runs().len(), 2 + of_another.len());
        // The file of a socket that was replaced belongs to whoever made it.
        std::fs::remove_file(listener.path()).unwrap();
        let path = listener.path().to_path_buf();
        let replaced = UnixListener::bind(&path).unwrap();
        drop(listener);
        assert!(path.exists());
        drop(replaced);
    }

    #[test]
    fn what_the_dead_left_behind_is_removed_and_nothing_else() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path());
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let stale = scratch.path().join(format!("{}-0.run", child.id()));
        let other = scratch.path().join("notes.txt");
        std::fs::write(&stale, "").unwrap();
        std::fs::write(&other, "").unwrap();
        assert_eq!(directory.runs(), []);
        assert!(!stale.exists() && other.exists());
    }

    #[test]
    fn a_folder_that_others_may_enter_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        std::fs::set_permissions(scratch.path(), std::fs::Permissions::from_mode(0o755)).unwrap();
        let refused = Directory::at(scratch.path()).listen();
        assert!(matches!(refused, Err(DirectoryError::NotPrivate(_))), "{refused:?}");
    }

    /// Who made the folder first wrote what this user's runs obeyed, and showed runs of its own.
    #[test]
    fn of_a_folder_of_another_user_nothing_is_believed() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("flotor"));
        let run = directory.listen().unwrap();
        let peer = scratch.path().join(format!("flotor/{}-pair.peer", std::process::id()));
        let coupling = Datagrams::bind(&peer).unwrap();
        directory.latch().press("a stranger").unwrap();
        let seen = |directory: &Directory| {
            let pressed = directory.latch().state().pressed.is_some();
            (directory.runs().len(), directory.couplings().len(), pressed)
        };
        assert_eq!(seen(&directory), (1, 1, true));
        // Only root can give it away; by a link to it nobody gets further.
        if getuid().is_root() {
            std::os::unix::fs::chown(directory.path(), Some(65534), None).unwrap();
            assert_eq!(seen(&directory), (0, 0, false));
            std::os::unix::fs::chown(directory.path(), Some(0), None).unwrap();
        }
        let link = Directory::at(scratch.path().join("link"));
        std::os::unix::fs::symlink(directory.path(), link.path()).unwrap();
        assert_eq!(seen(&link), (0, 0, false));
        drop((run, coupling));
    }
}
