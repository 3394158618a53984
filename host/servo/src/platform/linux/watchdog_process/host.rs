//! The host's side: starts the process, and tells it when it is needed no more.

use super::{PACKET_BYTES, Packet};
use crate::engine::process::parent::program;
use flotor_hal::Independence;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{
    AddressFamily, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage, SendFlags, SocketFlags, SocketType,
    recv, send, sendmsg, socketpair,
};
use rustix::thread::gettid;
use std::io::{self, IoSlice};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

/// How long the process may take to be on guard.
const PATIENCE: Timespec = Timespec { tv_sec: 5, tv_nsec: 0 };

/// The watchdog process of this host. Dropping it reports that the devices are stopped, and ends it.
pub struct WatchdogProcess {
    child: Child,
    link: OwnedFd,
}

impl WatchdogProcess {
    /// Starts it for the devices that are stopped by a message, each with its name; `None` if there are none. Not real-time.
    ///
    /// # Errors
    /// What the system says, or that it does not answer.
    pub fn start<'a>(
        devices: impl IntoIterator<Item = (&'a str, &'a Independence)>,
    ) -> io::Result<Option<Self>> {
        let by_message = |(name, means): (&'a str, &'a Independence)| match means {
            Independence::Message { handle, message, .. } => Some((name, handle, message)),
            Independence::Itself { .. } => None,
        };
        let devices: Vec<_> = devices.into_iter().filter_map(by_message).collect();
        if devices.is_empty() {
            return Ok(None);
        }
        let (link, theirs) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
        let mut command = Command::new(program()?);
        command.args(["watchdog", "--host", &std::process::id().to_string()]);
        command.stdin(Stdio::from(theirs)).stdout(Stdio::null()).process_group(0);
        let child = command.spawn()?;
        drop(command); // and with it the other end of the link
        let process = Self { child, link };
        for (name, handle, message) in devices {
            process.hand_over(handle, message)?;
            process.say(Packet::Name, name.as_bytes())?;
        }
        process.say(Packet::Begin, &[])?;
        process.wait_until_ready()?;
        Ok(Some(process))
    }

    /// The calling thread runs the loop: when it ends without an end in order, the host counts as gone. Not real-time.
    ///
    /// # Errors
    /// The process is gone.
    pub fn follow_this_thread(&self) -> io::Result<()> {
        self.say(Packet::Thread, &gettid().as_raw_nonzero().get().to_le_bytes())
    }

    fn say(&self, packet: Packet, rest: &[u8]) -> io::Result<()> {
        send(&self.link, &bytes_of(packet, rest), SendFlags::NOSIGNAL)?;
        Ok(())
    }

    fn hand_over(&self, handle: &OwnedFd, message: &[u8]) -> io::Result<()> {
        let mut room = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
        let mut beside = SendAncillaryBuffer::new(&mut room);
        let handles = [handle.as_fd()];
        beside.push(SendAncillaryMessage::ScmRights(&handles));
        let bytes = bytes_of(Packet::Device, message);
        sendmsg(&self.link, &[IoSlice::new(&bytes)], &mut beside, SendFlags::NOSIGNAL)?;
        Ok(())
    }

    /// Whether it has ended before it was told to, whatever ended it. Not real-time.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        // It says nothing more: whatever there is to see is the end of the link.
        let mut link = [PollFd::new(&self.link, PollFlags::IN)];
        poll(&mut link, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })).is_ok_and(|seen| seen > 0)
    }

    fn wait_until_ready(&self) -> io::Result<()> {
        let mut answer = [0; 1];
        let mut link = [PollFd::new(&self.link, PollFlags::IN)];
        let is_there = poll(&mut link, Some(&PATIENCE))? > 0;
        let length = if is_there { recv(&self.link, &mut answer, RecvFlags::empty())?.0 } else { 0 };
        if length == 1 && Packet::of(answer[0]) == Some(Packet::Ready) {
            return Ok(());
        }
        Err(io::Error::other("the watchdog process does not answer"))
    }
}

/// A packet, its end cut off if it is too long.
fn bytes_of(packet: Packet, rest: &[u8]) -> Vec<u8> {
    std::iter::once(packet as u8).chain(rest.iter().copied()).take(PACKET_BYTES).collect()
}

impl Drop for WatchdogProcess {
    fn drop(&mut self) {
        if self.say(Packet::End, &[]).is_err() {
            let _ = self.child.kill(); // gone already
        }
        let _ = self.child.wait();
    }
}
