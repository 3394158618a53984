//! Frames on links without packets: COBS-coded (Cheshire and Baker 1999), each terminated by a zero byte.
//!
//! After lost bytes a reader resynchronises at the next zero.

use super::codec::FRAME_BYTES;

/// Maximum length of a coded frame with its terminating zero, bytes.
pub const CODED_BYTES: usize = corncobs::max_encoded_len(FRAME_BYTES);

/// Result of decoding the bytes up to a zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A packet of the right length.
    Packet([u8; FRAME_BYTES]),
    /// Bytes that form no packet.
    Malformed,
}

/// Encodes a frame for the link; returns the buffer and the number of used bytes.
#[must_use]
pub fn coded(frame: &[u8; FRAME_BYTES]) -> ([u8; CODED_BYTES], usize) {
    let mut bytes = [0; CODED_BYTES];
    let length = corncobs::encode_buf(frame, &mut bytes);
    (bytes, length)
}

/// Decoder of COBS-coded packets from a byte stream.
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
    /// Decodes one byte; returns the packet that the byte completes, `None` if no packet is complete.
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

    /// Returns the packet before a zero; `None` without a byte between two zeros.
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
