//! The emulator's link to the host program: packets, or the bytes of a serial port.

use super::bus::{Attachment, Bus};
use super::personality::Personality;
use flotor_maglev::protocol::FRAME_BYTES;
use flotor_maglev::transport::stream::StreamLink;
use flotor_maglev::transport::{Incoming, LinkLost, Transport};
use std::io::{self, ErrorKind, Read, Write};
use std::sync::Arc;
use std::time::Duration;

/// Returns the link to the host that uses the device.
pub(super) fn open(bus: Arc<Bus>, attachment: Attachment) -> Box<dyn Transport> {
    match bus.personality {
        Personality::Serial => {
            let port = GadgetPort { bus: Arc::clone(&bus), attachment, rest: Vec::new(), taken: 0 };
            Box::new(SerialLink { bus, attachment, stream: StreamLink::new(port) })
        }
        Personality::Interrupt | Personality::Bulk | Personality::Hid => {
            Box::new(GadgetLink { bus, attachment })
        }
    }
}

struct GadgetLink {
    bus: Arc<Bus>,
    attachment: Attachment,
}

impl Transport for GadgetLink {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        self.bus.send(self.attachment, frame).map_err(|_| LinkLost)
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        self.wait(Duration::ZERO)
    }

    fn wait(&mut self, patience: Duration) -> Result<Incoming, LinkLost> {
        let packet = self.bus.take(self.attachment, patience).map_err(|_| LinkLost)?;
        Ok(match packet.as_deref().map(<[u8; FRAME_BYTES]>::try_from) {
            None => Incoming::Nothing,
            Some(Ok(packet)) => Incoming::Packet(packet),
            Some(Err(_)) => Incoming::Malformed,
        })
    }
}

struct SerialLink {
    bus: Arc<Bus>,
    attachment: Attachment,
    stream: StreamLink<GadgetPort>,
}

impl Transport for SerialLink {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        self.stream.send(frame)
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        self.stream.receive()
    }

    fn wait(&mut self, patience: Duration) -> Result<Incoming, LinkLost> {
        match self.stream.receive()? {
            Incoming::Nothing => {
                self.bus.wait_for_packet(self.attachment, patience);
                self.stream.receive()
            }
            incoming => Ok(incoming),
        }
    }
}

/// Device side of a serial port.
struct GadgetPort {
    bus: Arc<Bus>,
    attachment: Attachment,
    /// Packet from the host, read up to `taken`.
    rest: Vec<u8>,
    taken: usize,
}

impl Read for GadgetPort {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.taken >= self.rest.len() {
            match self.bus.take(self.attachment, Duration::ZERO) {
                Ok(Some(packet)) => (self.rest, self.taken) = (packet, 0),
                Ok(None) => return Err(ErrorKind::WouldBlock.into()),
                Err(_) => return Ok(0),
            }
        }
        let mut bytes = self.rest.get(self.taken..).unwrap_or_default();
        let length = bytes.read(buffer)?;
        self.taken += length;
        Ok(length)
    }
}

impl Write for GadgetPort {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.bus.send(self.attachment, buffer).map_err(|_| io::Error::from(ErrorKind::BrokenPipe))?;
        Ok(buffer.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
