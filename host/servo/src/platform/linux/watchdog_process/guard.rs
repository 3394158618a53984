//! Guard side: the watchdog process itself.

use super::control_group::join_separate_group;
use super::{PACKET_BYTES, Packet, bytes_of};
use crate::realtime::enter_guard_priority;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, write};
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::net::{RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendFlags, recvmsg, send};
use rustix::process::{Pid, PidfdFlags, getppid, pidfd_open, setsid};
use std::io::{self, IoSliceMut, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

/// Number of times a message is written: the first may follow an incomplete command of the host, the second then starts a new
/// message, the third is a spare.
const TIMES: u32 = 3;
/// Pause between two writes, longer than a device takes to process a message.
const PAUSE: Duration = Duration::from_millis(2);
/// Timeout of a write to a handle with a full buffer.
const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 5_000_000 };

/// Grace period for a host whose thread has ended to report an orderly end.
const LAST_WORD: Timespec = Timespec { tv_sec: 0, tv_nsec: 1_000_000 };

/// Guarded device: its name, the duplicated handle, and the message that stops it.
struct Guarded {
    name: String,
    handle: OwnedFd,
    message: Vec<u8>,
}

/// Guards the devices that the host with process id `host` passes over standard input. Returns when the host has reported its
/// devices stopped, or has ended and the devices are stopped. Not real-time.
///
/// # Errors
/// If standard input is not a host's socket (the process was not started as a watchdog), the host passes no devices, or there is no
/// process `host`.
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
            // The host has ended before any device was energised, or the other end is not a host.
            _ => return Err(io::Error::other("the host passed no devices")),
        }
    }
    let Some(process) = host_number.and_then(|host| pidfd_open(host, PidfdFlags::empty()).ok()) else {
        return Err(io::Error::other("the process of --host does not exist"));
    };
    if getppid() != host_number {
        return Ok(()); // ended, and its id is in use again
    }
    // A kill of the host's session, process group or control group must not reach this process.
    let _ = setsid();
    let shared_group = join_separate_group(host).unwrap_or_default();
    enter_guard_priority();
    let _ = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
    send(link.as_fd(), &bytes_of(Packet::Ready, shared_group.as_bytes()), SendFlags::NOSIGNAL)?;
    let mut watch = Watch { link, process, thread: None, patience: None };
    let event = loop {
        match watch.wait_for_event() {
            // The host may continue, or be killed later: this process keeps watching.
            Event::HostSilent => {
                stop(&devices);
                report("the host is suspended or hangs", &devices);
            }
            event => break event,
        }
    };
    if event == Event::HostGone {
        stop(&devices);
        report("the host has ended", &devices);
    }
    Ok(())
}

/// Reports the reason and the stopped devices on standard error.
fn report(why: &str, devices: &[Guarded]) {
    let names: Vec<String> =
        devices.iter().map(|device| format!("`{}`", device.name.escape_debug())).collect();
    let _ = writeln!(io::stderr(), "flotor watchdog: {why}; stopped {}", names.join(", "));
}

/// Event at the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    EndedInOrder,
    /// The host exists but has sent no heartbeat in time.
    HostSilent,
    HostGone,
}

/// Sources of events at a host.
struct Watch<L> {
    link: L,
    process: OwnedFd,
    /// Thread of the host's loop.
    thread: Option<OwnedFd>,
    /// Timeout of the next heartbeat; `None` if none is announced.
    patience: Option<Timespec>,
}

impl<L: AsFd> Watch<L> {
    /// Waits until the host reports its end, closes the link or ends, until its loop thread ends, or until its heartbeat is overdue.
    fn wait_for_event(&mut self) -> Event {
        loop {
            let Self { link, process, thread, patience } = self;
            let mut all = vec![PollFd::new(&*link, PollFlags::IN), PollFd::new(&*process, PollFlags::IN)];
            all.extend(thread.as_ref().map(|thread| PollFd::new(thread, PollFlags::IN)));
            match poll(&mut all, patience.as_ref()) {
                Ok(0) => {
                    self.patience = None;
                    return Event::HostSilent;
                }
                Ok(_) => {}
                Err(Errno::INTR) => continue,
                Err(_) => return Event::HostGone,
            }
            if all.first().is_none_or(|said| said.revents().is_empty()) {
                // No packet, so something has ended. An end report may still come from another thread.
                let mut link = [PollFd::new(&*link, PollFlags::IN)];
                if !poll(&mut link, Some(&LAST_WORD)).is_ok_and(|seen| seen > 0) {
                    return Event::HostGone;
                }
            }
            match receive(self.link.as_fd()) {
                Ok((Some(Packet::End), ..)) => return Event::EndedInOrder,
                Ok((Some(Packet::Thread), number, _)) => self.thread = thread_of(&number),
                Ok((Some(Packet::Alive), limit, _)) => self.patience = patience_of(&limit),
                Ok((Some(Packet::Quiet), ..)) => self.patience = None,
                _ => return Event::HostGone,
            }
        }
    }
}

/// Decodes the timeout that a heartbeat announces.
fn patience_of(limit_ns: &[u8]) -> Option<Timespec> {
    Timespec::try_from(Duration::from_nanos(u64::from_le_bytes(limit_ns.try_into().ok()?))).ok()
}

/// Returns a pidfd of the thread with the encoded id; `None` before Linux 6.9, which has pidfds of processes only.
fn thread_of(number: &[u8]) -> Option<OwnedFd> {
    // `PIDFD_THREAD`, which rustix does not name, has the value of `O_EXCL`.
    let of_thread = PidfdFlags::from_bits_retain(OFlags::EXCL.bits());
    pidfd_open(Pid::from_raw(i32::from_le_bytes(number.try_into().ok()?))?, of_thread).ok()
}

/// Writes the message of every device [`TIMES`] times, in rounds over all devices.
fn stop(devices: &[Guarded]) {
    for Guarded { handle, .. } in devices {
        // The file status flags are shared with the host's handle: the host, which has ended, hangs or is suspended, gets
        // `O_NONBLOCK` too.
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

/// Writes a message until it is complete, or the handle stays full for the timeout.
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

/// Receives the next packet: its kind, the bytes after the kind, and the attached handle. No kind if the other end is closed or the
/// kind is unknown.
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
        for (said, event) in
            [(&b"e"[..], Event::EndedInOrder), (b"", Event::HostGone), (b"x", Event::HostGone)]
        {
            let (host, link) =
                socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
                    .expect("two ends");
            let own =
                pidfd_open(rustix::process::getpid(), PidfdFlags::empty()).expect("this process is there");
            if !said.is_empty() {
                send(&host, said, SendFlags::NOSIGNAL).expect("it is sent");
            }
            drop(host);
            assert_eq!(watch(link, own).wait_for_event(), event, "{said:?}");
        }
    }

    fn watch(link: OwnedFd, process: OwnedFd) -> Watch<OwnedFd> {
        Watch { link, process, thread: None, patience: None }
    }

    #[test]
    fn a_host_that_promised_a_sign_of_life_and_gives_none_is_silent_until_it_is_quiet_or_gone() {
        let (host, link) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
            .expect("two ends");
        let own = pidfd_open(rustix::process::getpid(), PidfdFlags::empty()).expect("this process is there");
        let mut watch = watch(link, own);
        let say = |packet: &[u8]| send(&host, packet, SendFlags::NOSIGNAL).expect("it is sent");
        let alive = [&[Packet::Alive as u8][..], &1_000_000_u64.to_le_bytes()].concat();
        say(&alive);
        assert_eq!(watch.wait_for_event(), Event::HostSilent);
        // Once: nothing more is due until the next sign. One that is quiet may be so for ever.
        say(&alive);
        say(&[Packet::Quiet as u8]);
        say(&[Packet::End as u8]);
        assert_eq!(watch.wait_for_event(), Event::EndedInOrder);
        drop(host);
        assert_eq!(watch.wait_for_event(), Event::HostGone);
    }

    #[test]
    fn a_host_whose_loop_ends_without_a_word_is_gone_however_long_its_other_threads_live() {
        for (last_words, event) in [(&b"e"[..], Event::EndedInOrder), (b"", Event::HostGone)] {
            let (host, link) =
                socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
                    .expect("two ends");
            let own =
                pidfd_open(rustix::process::getpid(), PidfdFlags::empty()).expect("this process is there");
            let (begin, begun) = std::sync::mpsc::channel::<()>();
            std::thread::scope(|scope| {
                let host = &host;
                scope.spawn(move || {
                    let number = rustix::thread::gettid().as_raw_nonzero().get().to_le_bytes();
                    let packet = [&[Packet::Thread as u8][..], &number].concat();
                    send(host, &packet, SendFlags::NOSIGNAL).expect("it is sent");
                    begun.recv().expect("it is told");
                    if !last_words.is_empty() {
                        send(host, last_words, SendFlags::NOSIGNAL).expect("it is sent");
                    }
                });
                let waiting = scope.spawn(|| watch(link, own).wait_for_event());
                // It waits by now, or will see the thread end all the same.
                std::thread::sleep(Duration::from_millis(20));
                begin.send(()).expect("it listens");
                assert_eq!(waiting.join().expect("it returns"), event, "{last_words:?}");
            });
        }
    }
}
