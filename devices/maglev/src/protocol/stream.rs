//! Frames on links without packets: COBS-coded (Cheshire and Baker 1999), each ended by a zero byte.
//!
//! A reader that comes in late, or loses bytes, is in step again at the next zero.

use super::frame::FRAME_BYTES;

/// Bytes of a coded frame, its zero included.
pub const CODED_BYTES: usize = corncobs::max_encoded_len(FRAME_BYTES);

/// What one byte completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A packet of the right length.
    Packet([u8; FRAME_BYTES]),
    /// Something that is no packet.
    Malformed,
}

/// A frame as it goes over the link: its bytes, and how many of them.
#[must_use]
pub fn coded(frame: &[u8; FRAME_BYTES]) -> ([u8; CODED_BYTES], usize) {
    let mut bytes = [0; CODED_BYTES];
    let length = corncobs::encode_buf(frame, &mut bytes);
    (bytes, length)
}

/// Puts bytes together to packets.
#[derive(Clone, Debug)]
pub struct StreamDecoder {
    bytes: [u8; CODED_BYTES],
    length: usize,
    overflown: bool,
}

impl Default for StreamDecoder {
    fn default() -> Self {
        Self { bytes: [0; CODED_BYTES], length: 0, overflown: false }
    }
}

impl StreamDecoder {
    /// Takes one byte.
    pub fn push(&mut self, byte: u8) -> Option<Received> {
        match self.bytes.get_mut(self.length) {
            Some(slot) => {
                *slot = byte;
                self.length += 1;
            }
            None => self.overflown = true,
        }
        (byte == 0).then(|| self.finish()).flatten()
    }

    /// The packet before a zero; nothing between two zeros.
    fn finish(&mut self) -> Option<Received> {
        let Self { mut bytes, length, overflown } = std::mem::take(self);
        if length <= 1 && !overflown {
            return None;
        }
        let decoded = bytes.get_mut(..length).and_then(|coded| corncobs::decode_in_place(coded).ok());
        let packet = decoded.filter(|_| !overflown).and_then(|length| bytes.get(..length)?.try_into().ok());
        Some(packet.map_or(Received::Malformed, Received::Packet))
    }
}
