//! Both ends of the link, and what is said over it.

mod control_group;
mod guard;
mod host;

pub use guard::serve;
pub use host::{SignOfLife, WatchdogProcess, probe_shared_group};

/// Whether this system has one: it has. Not real-time.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // as on other systems
pub fn is_offered() -> std::io::Result<()> {
    Ok(())
}

/// Bytes of the longest packet between the two: what it says, and a message or a name.
const PACKET_BYTES: usize = 128;

/// First byte of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Packet {
    /// To the process: a device's message, and its handle beside it.
    Device = b'd',
    /// To the process: the name of that device, for people.
    Name = b'n',
    /// To the process: these were all.
    Begin = b'b',
    /// To the process: the number of the thread that runs the loop, nothing where none does any more. A killed process ends with its last thread, which on a busy
    /// machine may wait for its turn; this one has priority.
    Thread = b't',
    /// To the process: the host runs, and says so again within this many ns. A process that is stopped does not.
    Alive = b'a',
    /// To the process: the host says no more that it runs.
    Quiet = b'q',
    /// From the process: it is on guard; the control group that it shares with the host, if it could not leave one.
    Ready = b'r',
    /// To the process: the devices are stopped, nobody has to guard them any more.
    End = b'e',
}

impl Packet {
    fn of(byte: u8) -> Option<Self> {
        const ALL: [Packet; 8] = [
            Packet::Device,
            Packet::Name,
            Packet::Begin,
            Packet::Thread,
            Packet::Alive,
            Packet::Quiet,
            Packet::Ready,
            Packet::End,
        ];
        ALL.into_iter().find(|packet| *packet as u8 == byte)
    }
}

/// A packet, its end cut off if it is too long.
fn bytes_of(packet: Packet, rest: &[u8]) -> Vec<u8> {
    std::iter::once(packet as u8).chain(rest.iter().copied()).take(PACKET_BYTES).collect()
}
