//! Chip at the other end of a TCP connection: an emulated device in another process, for machines without an emulated USB bus.
//!
//! ```text
//! host    'R' request u8 value u16     'W' length u8 bytes        little-endian
//! device  length u8 packet
//! ```

use crate::chip::{Chip, ChipLost, PACKET_BYTES, Request};
use crate::platform::descriptor;
use flotor_hal::{IndependentStop, StoppedState};
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// First byte of a chip request.
pub const REQUEST: u8 = b'R';
/// First byte of data for the serial line.
pub const WRITE: u8 = b'W';
/// Time in which an emulator has set its motors to rest, ns; declared for the independent stop.
const STOP_NS: u64 = 5_000_000;
/// Limit on the data of one message, bytes.
const PIECE_BYTES: usize = 255;

/// Connection to an emulated chip.
#[derive(Debug)]
pub struct RemoteChip {
    writer: Mutex<TcpStream>,
    reader: Mutex<Reader>,
}

#[derive(Debug)]
struct Reader {
    stream: TcpStream,
    /// Received part of the next packet, after its length byte.
    bytes: [u8; 1 + PACKET_BYTES],
    length: usize,
}

impl RemoteChip {
    /// Connects to an emulator. Not real-time.
    ///
    /// # Errors
    /// If the connection fails.
    pub fn connect(address: &str) -> io::Result<Self> {
        let stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        let reader = Reader { stream: stream.try_clone()?, bytes: [0; 1 + PACKET_BYTES], length: 0 };
        Ok(Self { writer: Mutex::new(stream), reader: Mutex::new(reader) })
    }

    fn send(&self, head: &[u8], bytes: &[u8]) -> Result<(), ChipLost> {
        let mut message = [0; 4 + PIECE_BYTES];
        let length = head.len() + bytes.len();
        message.iter_mut().zip(head.iter().chain(bytes)).for_each(|(place, byte)| *place = *byte);
        let mut stream = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        stream.write_all(message.get(..length).unwrap_or_default()).map_err(|_| ChipLost)
    }
}

impl Chip for RemoteChip {
    fn request(&self, request: Request, value: u16) -> Result<(), ChipLost> {
        let [low, high] = value.to_le_bytes();
        self.send(&[REQUEST, request as u8, low, high], &[])
    }

    fn write(&self, bytes: &[u8]) -> Result<(), ChipLost> {
        bytes.chunks(PIECE_BYTES).try_for_each(|piece| {
            let length = u8::try_from(piece.len()).unwrap_or(u8::MAX);
            self.send(&[WRITE, length], piece)
        })
    }

    fn independent_stop(&self, rest: &[u8]) -> IndependentStop {
        let stream = self.writer.lock().unwrap_or_else(PoisonError::into_inner);
        let length = u8::try_from(rest.len()).unwrap_or(u8::MAX);
        let message = [&[WRITE, length], rest].concat();
        IndependentStop::by_message(descriptor(&stream), &message, StoppedState::Zero, STOP_NS)
    }

    fn read(&self, packets: &mut [u8], patience: Duration) -> Result<usize, ChipLost> {
        let mut reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        let Reader { stream, bytes, length } = &mut *reader;
        stream.set_read_timeout(Some(patience.max(Duration::from_micros(1)))).map_err(|_| ChipLost)?;
        loop {
            let wanted = if *length == 0 { 1 } else { 1 + usize::from(bytes[0]).min(PACKET_BYTES) };
            if *length > 0 && *length == wanted {
                *length = 0;
                let packet = bytes.get(1..wanted).unwrap_or_default();
                packets.iter_mut().zip(packet).for_each(|(place, byte)| *place = *byte);
                return Ok(packet.len());
            }
            match stream.read(bytes.get_mut(*length..wanted).unwrap_or_default()) {
                Ok(0) => return Err(ChipLost),
                Ok(count) => *length += count,
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(0),
                    ErrorKind::Interrupted => {}
                    _ => return Err(ChipLost),
                },
            }
        }
    }
}
