//! Host side: start and end of the watchdog process.

use super::{PACKET_BYTES, Packet, bytes_of};
use crate::engine::process::parent::{cannot_start, program};
use flotor_loader::Independence;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{
    AddressFamily, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage, SendFlags, SocketFlags, SocketType,
    recv, send, sendmsg, socketpair,
};
use rustix::thread::gettid;
use std::io::{self, IoSlice};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::process::{Child, Command, Stdio};

/// Timeout for the watchdog process to be ready.
const PATIENCE: Timespec = Timespec { tv_sec: 5, tv_nsec: 0 };

/// Watchdog process of this host. Dropping the value reports to the process that the devices are stopped, and waits for the end of
/// the process.
pub struct WatchdogProcess {
    child: Child,
    link: OwnedFd,
    shared_group: Option<String>,
}

impl WatchdogProcess {
    /// Starts the watchdog process for the `devices` (each with its name) that are stopped by a message, and waits until the
    /// process is ready; `None` if no device is stopped by a message. Not real-time.
    ///
    /// # Errors
    /// If a system call fails, or the process is not ready within 5 s.
    pub fn start<'a>(
        devices: impl IntoIterator<Item = (&'a str, &'a Independence)>,
    ) -> io::Result<Option<Self>> {
        let by_message = |(name, means): (&'a str, &'a Independence)| match means {
            Independence::Message { handle, message, .. } => Some((name, handle, &message[..])),
            Independence::Itself { .. } => None,
        };
        let devices: Vec<_> = devices.into_iter().filter_map(by_message).collect();
        if devices.is_empty() {
            return Ok(None);
        }
        Self::start_for(&devices).map(Some)
    }

    fn start_for(devices: &[(&str, &OwnedFd, &[u8])]) -> io::Result<Self> {
        let (link, theirs) =
            socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)?;
        let mut command = Command::new(program()?);
        command.args(["watchdog", "--host", &std::process::id().to_string()]);
        command.stdin(Stdio::from(theirs)).stdout(Stdio::null());
        let child = command.spawn().map_err(|error| cannot_start(&command, &error))?;
        drop(command); // and with it the other end of the link
        let mut process = Self { child, link, shared_group: None };
        for (name, handle, message) in devices {
            process.hand_over(handle, message)?;
            process.say(Packet::Name, name.as_bytes())?;
        }
        process.say(Packet::Begin, &[])?;
        process.shared_group = process.wait_until_ready()?;
        Ok(process)
    }

    /// Returns the control group that the process could not leave and therefore shares with the host: a kill of the group ends both
    /// processes. `None` if the processes share no group.
    #[must_use]
    pub fn shared_group(&self) -> Option<&str> {
        self.shared_group.as_deref()
    }

    /// Returns a sender of heartbeats to the process. Not real-time.
    ///
    /// # Errors
    /// If the system has no further descriptor.
    pub fn heartbeat_sender(&self) -> io::Result<HeartbeatSender> {
        Ok(HeartbeatSender { link: self.link.try_clone()? })
    }

    /// Registers the calling thread as the loop thread: if the thread ends before an orderly end is reported, the watchdog process
    /// stops the devices, as at the end of the host. Not real-time.
    ///
    /// # Errors
    /// If the watchdog process has ended.
    pub fn follow_this_thread(&self) -> io::Result<()> {
        self.say(Packet::Thread, &gettid().as_raw_nonzero().get().to_le_bytes())
    }

    /// Unregisters the loop thread, which may end from now on; only the host's process is watched. Not real-time.
    ///
    /// # Errors
    /// If the watchdog process has ended.
    pub fn follow_no_thread(&self) -> io::Result<()> {
        self.say(Packet::Thread, &[])
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

    /// Returns true if the watchdog process has ended early, for any reason. Not real-time.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        // The process sends nothing more: any event is the end of the link.
        let mut link = [PollFd::new(&self.link, PollFlags::IN)];
        poll(&mut link, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })).is_ok_and(|seen| seen > 0)
    }

    /// Waits until the process is ready; returns the control group that the process could not leave.
    fn wait_until_ready(&self) -> io::Result<Option<String>> {
        let mut answer = [0; PACKET_BYTES];
        let mut link = [PollFd::new(&self.link, PollFlags::IN)];
        let is_there = poll(&mut link, Some(&PATIENCE))? > 0;
        let length = if is_there { recv(&self.link, &mut answer, RecvFlags::empty())?.0 } else { 0 };
        match answer.get(..length).and_then(<[u8]>::split_first) {
            Some((first, group)) if Packet::of(*first) == Some(Packet::Ready) => {
                Ok(Some(String::from_utf8_lossy(group).into_owned()).filter(|group| !group.is_empty()))
            }
            _ if is_there => Err(io::Error::other("the watchdog process ended before it was ready")),
            _ => Err(io::Error::other(format!(
                "the watchdog process did not answer within {} s",
                PATIENCE.tv_sec
            ))),
        }
    }
}

/// Sender of heartbeats to the watchdog process, which stops the devices if a heartbeat is overdue, because this process is
/// suspended or traced. Dropping it announces that no more heartbeats follow.
pub struct HeartbeatSender {
    link: OwnedFd,
}

impl HeartbeatSender {
    /// Sends a heartbeat and announces the next heartbeat within `limit_ns`. Bounded: never waits.
    pub(crate) fn give(&self, limit_ns: u64) {
        self.send(&bytes_of(Packet::Alive, &limit_ns.to_le_bytes()));
    }

    fn send(&self, packet: &[u8]) {
        // A process that reads nothing is stopped itself, or has ended: the run finds out in its own check.
        let _ = send(&self.link, packet, SendFlags::NOSIGNAL | SendFlags::DONTWAIT);
    }
}

impl Drop for HeartbeatSender {
    fn drop(&mut self) {
        self.send(&[Packet::Quiet as u8]);
    }
}

/// Starts a watchdog process without devices and ends the process; returns the control group that both processes shared, `None` if
/// they shared no group. Not real-time.
///
/// # Errors
/// As for [`WatchdogProcess::start`].
pub fn probe_shared_group() -> io::Result<Option<String>> {
    WatchdogProcess::start_for(&[]).map(|process| process.shared_group.clone())
}

impl Drop for WatchdogProcess {
    fn drop(&mut self) {
        if self.say(Packet::End, &[]).is_err() {
            let _ = self.child.kill(); // gone already
        }
        let _ = self.child.wait();
    }
}
