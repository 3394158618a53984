//! Unix: a pair of local sockets without a name.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, recv, send, socketpair};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

/// End of a pair.
pub(crate) struct Socket(OwnedFd);

impl Socket {
    /// Starts a program with the other end as its standard input, in a process group of its own: Ctrl-C ends the run first. What it
    /// prints goes to the standard error.
    pub(crate) fn start(program: &Path) -> io::Result<(Self, Child)> {
        let (ours, theirs) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
        let mut command = Command::new(program);
        command.stdin(theirs).stdout(io::stderr()).process_group(0);
        Ok((Self(ours), command.spawn()?))
    }

    /// Returns the end that is the standard input of this process.
    pub(crate) fn of_standard_input() -> io::Result<Self> {
        io::stdin().as_fd().try_clone_to_owned().map(Self)
    }

    /// Sends a message, `WouldBlock` if the other side reads too slowly.
    pub(crate) fn send(&self, message: &[u8]) -> io::Result<()> {
        send(&self.0, message, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)?;
        Ok(())
    }

    /// Receives a message; returns its size, which may be larger than `bytes`, and 0 at the end. `WouldBlock` without a message.
    pub(crate) fn receive(&self, bytes: &mut [u8]) -> io::Result<usize> {
        match recv(&self.0, bytes, RecvFlags::DONTWAIT | RecvFlags::TRUNC) {
            Ok((_, size)) => Ok(size),
            Err(rustix::io::Errno::CONNRESET) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }

    /// Waits for a message or the end; returns false if the time is over before.
    pub(crate) fn wait(&self, most: Option<Duration>) -> io::Result<bool> {
        let most = most.map(Timespec::try_from).transpose().map_err(io::Error::other)?;
        let ready = poll(&mut [PollFd::new(&self.0, PollFlags::IN)], most.as_ref())?;
        Ok(ready > 0)
    }
}
