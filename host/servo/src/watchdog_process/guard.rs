//! The process itself.

use super::{PACKET_BYTES, Packet};
use crate::realtime::enter_guard_priority;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, write};
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::net::{RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendFlags, recvmsg, send};
use rustix::process::{Pid, PidfdFlags, getppid, pidfd_open};
use std::io::{self, IoSliceMut, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

/// How often a message is written: the first may fall into half a command of the host's, the second then finds the
/// beginning of a message, the third is for luck.
const TIMES: u32 = 3;
/// Time between two of them, longer than a device takes to look at one.
const PAUSE: Duration = Duration::from_millis(2);
/// How long a handle that is full is waited for, each time.
const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 5_000_000 };

/// A device on guard.
struct Guarded {
    name: String,
    handle: OwnedFd,
    message: Vec<u8>,
}

/// Guards the devices that the host, whose process has this number, passes on standard input; returns when the host has said that
/// its devices are stopped, or after they were stopped from here.
///
/// # Errors
/// Standard input is no such socket: nobody started this as a watchdog.
pub fn serve(host: i32) -> io::Result<()> {
    let link = io::stdin();
    let host_number = Pid::from_raw(host);
    let mut devices: Vec<Guarded> = Vec::new();
    loop {
        let (packet, rest, handle) = receive(link.as_fd())?;
        match (packet, handle) {
            (Some(Packet::Device), Some(handle)) => {
                devices.push(Guarded { name: String::new(), handle, message: rest });
            }
            (Some(Packet::Name), _) => {
                if let Some(device) = devices.last_mut() {
                    device.name = String::from_utf8_lossy(&rest).into_owned();
                }
            }
            (Some(Packet::Begin), _) => break,
            // It has gone before anything was energised, or is no host.
            _ => return Err(io::Error::other("nobody passes any devices")),
        }
    }
    let Some(process) = host_number.and_then(|host| pidfd_open(host, PidfdFlags::empty()).ok()) else {
        return Err(io::Error::other("there is no process of the host's number"));
    };
    if getppid() != host_number {
        return Ok(()); // gone, and another one has its number
    }
    enter_guard_priority();
    let _ = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
    send(link.as_fd(), &[Packet::Ready as u8], SendFlags::NOSIGNAL)?;
    if wait_for_end(link.as_fd(), &process) == Ended::InOrder {
        return Ok(());
    }
    stop(&devices);
    let names: Vec<String> =
        devices.iter().map(|device| format!("`{}`", device.name.escape_debug())).collect();
    let _ = writeln!(io::stderr(), "flotor watchdog: the host is gone; stopped {}", names.join(", "));
    Ok(())
}

/// How a host ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    InOrder,
    Gone,
}

/// Waits until the host says that it is over, closes the link, or ends.
fn wait_for_end(link: impl AsFd, process: &OwnedFd) -> Ended {
    loop {
        let mut both = [PollFd::new(&link, PollFlags::IN), PollFd::new(process, PollFlags::IN)];
        match poll(&mut both, None) {
            Ok(_) => {}
            Err(Errno::INTR) => continue,
            Err(_) => return Ended::Gone,
        }
        let [said, ended] = both.map(|which| !which.revents().is_empty());
        if said {
            return match receive(link.as_fd()) {
                Ok((Some(Packet::End), ..)) => Ended::InOrder,
                _ => Ended::Gone,
            };
        }
        if ended {
            return Ended::Gone;
        }
    }
}

/// Writes each message, to all devices before it is written once more.
fn stop(devices: &[Guarded]) {
    for Guarded { handle, .. } in devices {
        // The host, whose handle this is as well, is gone: nobody else minds.
        if let Ok(mode) = fcntl_getfl(handle) {
            let _ = fcntl_setfl(handle, mode | OFlags::NONBLOCK);
        }
    }
    for time in 0..TIMES {
        if time > 0 {
            std::thread::sleep(PAUSE);
        }
        for Guarded { handle, message, .. } in devices {
            put(handle, message);
        }
    }
}

/// Writes a message until it is taken, or nothing has been for a while.
fn put(handle: &OwnedFd, message: &[u8]) {
    let mut left = message;
    while !left.is_empty() {
        match write(handle, left) {
            Ok(written) => left = left.get(written..).unwrap_or_default(),
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => {
                let mut full = [PollFd::new(handle, PollFlags::OUT)];
                if !poll(&mut full, Some(&PATIENCE)).is_ok_and(|ready| ready > 0) {
                    return;
                }
            }
            Err(_) => return,
        }
    }
}

/// The next packet: what it says, the rest of it, and the handle beside it; nothing if the other end is closed.
fn receive(link: impl AsFd) -> io::Result<(Option<Packet>, Vec<u8>, Option<OwnedFd>)> {
    let mut bytes = [0; PACKET_BYTES];
    let mut room = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut beside = RecvAncillaryBuffer::new(&mut room);
    let flags = RecvFlags::CMSG_CLOEXEC;
    let length = loop {
        match recvmsg(&link, &mut [IoSliceMut::new(&mut bytes)], &mut beside, flags) {
            Ok(received) => break received.bytes,
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    };
    let handles = beside.drain().filter_map(|message| match message {
        RecvAncillaryMessage::ScmRights(handles) => Some(handles),
        _ => None,
    });
    let handle = handles.flatten().next();
    let Some((first, rest)) = bytes.get(..length).and_then(<[u8]>::split_first) else {
        return Ok((None, Vec::new(), None));
    };
    Ok((Packet::of(*first), rest.to_vec(), handle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
    use std::io::Read;

    #[test]
    fn a_message_is_written_until_it_is_taken_and_some_times_over() {
        let (mut reader, writer) = io::pipe().expect("a pipe");
        let device = Guarded { name: "d".to_owned(), handle: writer.into(), message: b"stop".to_vec() };
        stop(&[device]);
        let mut written = Vec::new();
        reader.read_to_end(&mut written).expect("it was closed");
        assert_eq!(written, b"stopstopstop");
    }

    #[test]
    fn a_host_that_closes_the_link_is_gone_and_one_that_says_so_has_ended() {
        for (said, ended) in [(&b"e"[..], Ended::InOrder), (b"", Ended::Gone), (b"x", Ended::Gone)] {
            let (host, link) =
                socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
                    .expect("two ends");
            let own =
                pidfd_open(rustix::process::getpid(), PidfdFlags::empty()).expect("this process is there");
            if !said.is_empty() {
                send(&host, said, SendFlags::NOSIGNAL).expect("it is sent");
            }
            drop(host);
            assert_eq!(wait_for_end(&link, &own), ended, "{said:?}");
        }
    }
}
