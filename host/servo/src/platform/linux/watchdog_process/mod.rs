//! Watchdog process on Linux: both ends of the link, and its packets.

mod control_group;
mod guard;
mod host;

pub use guard::serve;
pub use host::{HeartbeatSender, WatchdogProcess, probe_shared_group};

/// Returns `Ok`: this system has a watchdog process. Not real-time.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub fn is_offered() -> std::io::Result<()> {
    Ok(())
}

/// Longest packet, bytes: its kind, and a message or a name.
const PACKET_BYTES: usize = 128;

/// First byte of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Packet {
    /// To the process: message of a device, with its handle attached.
    Device = b'd',
    /// To the process: name of the last device, for users.
    Name = b'n',
    /// To the process: the list of devices is complete.
    Begin = b'b',
    /// To the process: id of the loop's thread, empty once the loop has ended. The guard also watches this thread, because a killed
    /// process exists until its last thread has ended, which on a busy machine may wait for a processor; the loop's thread, with
    /// real-time priority, ends first.
    Thread = b't',
    /// To the process: heartbeat of the host, with the time limit for the next heartbeat, ns. A suspended host sends no heartbeat.
    Alive = b'a',
    /// To the process: no more heartbeats follow.
    Quiet = b'q',
    /// From the process: ready; with the path of a control group shared with the host, empty if there is none.
    Ready = b'r',
    /// To the process: the devices are stopped and need not be guarded any more.
    End = b'e',
}

impl Packet {
    fn of(byte: u8) -> Option<Self> {
        use Packet::{Alive, Begin, Device, End, Name, Quiet, Ready, Thread};
        let all = [Device, Name, Begin, Thread, Alive, Quiet, Ready, End];
        all.into_iter().find(|packet| *packet as u8 == byte)
    }
}

/// Encodes a packet; a packet longer than [`PACKET_BYTES`] is truncated.
fn bytes_of(packet: Packet, rest: &[u8]) -> Vec<u8> {
    std::iter::once(packet as u8).chain(rest.iter().copied()).take(PACKET_BYTES).collect()
}
