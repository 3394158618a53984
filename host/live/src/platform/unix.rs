//! Unix: sockets that are files, permissions, processes by their number.

use rustix::io::Errno;
use rustix::process::{Pid, getuid, test_kill_process};
use std::fs::{DirBuilder, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

/// Where a datagram comes from.
pub(crate) use std::os::unix::net::SocketAddr as Address;
/// Where connections come in.
pub(crate) use std::os::unix::net::UnixListener as Listening;
/// A connection.
pub(crate) use std::os::unix::net::UnixStream as Stream;

/// Nobody but the owner.
const PRIVATE: u32 = 0o700;

/// The folder of the runs of this user, where the system names none.
pub(crate) fn run_folder() -> PathBuf {
    std::env::temp_dir().join(format!("flotor-{}", getuid().as_raw()))
}

/// Makes a folder that only this user may enter, if it is not there.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(PRIVATE).create(path)
}

/// Whether this is a folder of this user.
pub(crate) fn is_ours(attributes: &Metadata) -> bool {
    attributes.is_dir() && attributes.uid() == getuid().as_raw()
}

/// Whether this is a folder that only this user may enter.
pub(crate) fn is_ours_alone(attributes: &Metadata) -> bool {
    is_ours(attributes) && attributes.mode() & 0o077 == 0
}

/// A file that is made will be this user's alone.
pub(crate) fn private_file(options: &mut OpenOptions) -> &mut OpenOptions {
    options.mode(0o600)
}

/// Removes the file of a run whose process is no more; true if that is so. One of somebody else's process counts as one that is.
pub(crate) fn remove_if_over(path: &Path, process: u32) -> bool {
    let process = i32::try_from(process).ok().and_then(Pid::from_raw);
    let is_over = process.is_none_or(|process| test_kill_process(process) == Err(Errno::SRCH));
    if is_over {
        let _ = std::fs::remove_file(path); // somebody else may have been faster
    }
    is_over
}

/// Connects to the run behind a file.
pub(crate) fn connect(path: &Path) -> io::Result<Stream> {
    Stream::connect(path)
}

/// Waits for the next connection.
pub(crate) fn accept(socket: &Listening) -> io::Result<Stream> {
    socket.accept().map(|(stream, _)| stream)
}

/// A socket for datagrams, with the name of a file.
#[derive(Debug)]
pub(crate) struct Datagrams(UnixDatagram);

impl Datagrams {
    /// Makes it. It waits for nothing, both ways: the system's time-outs are some milliseconds long, whatever is asked for.
    pub(crate) fn bind(path: &Path) -> io::Result<Self> {
        UnixDatagram::bind(path).and_then(|socket| socket.set_nonblocking(true).map(|()| Self(socket)))
    }

    /// Sends to the socket of another name.
    pub(crate) fn send_to(&self, bytes: &[u8], path: &Path) -> io::Result<usize> {
        self.0.send_to(bytes, path)
    }

    /// The next datagram: its length, and where it comes from.
    pub(crate) fn recv_from(&self, buffer: &mut [u8]) -> io::Result<(usize, Address)> {
        self.0.recv_from(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Directory, DirectoryError};
    use std::os::unix::fs::PermissionsExt;

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
        assert!(matches!(refused, Err(DirectoryError::NotPrivate { .. })), "{refused:?}");
    }

    /// Who made the folder first wrote what this user's runs obeyed, and showed runs of its own.
    #[test]
    fn of_a_folder_of_another_user_nothing_is_believed() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("flotor"));
        let run = directory.listen().unwrap();
        let peer = scratch.path().join(format!("flotor/{}-pair.peer", std::process::id()));
        std::fs::write(peer, "").unwrap();
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
        drop(run);
    }
}
