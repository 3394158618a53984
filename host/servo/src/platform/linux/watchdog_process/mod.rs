//! Both ends of the link, and what is said over it.

mod guard;
mod host;

pub use guard::serve;
pub use host::WatchdogProcess;

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
    /// To the process: the number of the thread that runs the loop. A killed process ends with its last thread, which on a busy
    /// machine may wait for its turn; this one has priority.
    Thread = b't',
    /// From the process: it is on guard.
    Ready = b'r',
    /// To the process: the devices are stopped, nobody has to guard them any more.
    End = b'e',
}

impl Packet {
    fn of(byte: u8) -> Option<Self> {
        [Self::Device, Self::Name, Self::Begin, Self::Thread, Self::Ready, Self::End]
            .into_iter()
            .find(|packet| *packet as u8 == byte)
    }
}
