//! Framing of the messages in a stream of bytes.

use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_sync::Words;
use std::io::{self, Read};

/// Maximum length of a payload, bytes: a few seconds of ticks. A longer payload is malformed.
pub const MAX_PAYLOAD: usize = 1 << 21;
/// Length of a frame's head, bytes: payload length and kind.
const HEAD: usize = 5;
/// Length of an encoded record, bytes.
const RECORD: usize = 8 * RECORD_WORDS;

/// Kind of a frame, which determines its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// [`crate::Greeting`].
    Greeting = 1,
    /// `flotor.Run`.
    Run = 2,
    /// Records of ticks ([`ticks_from_payload`]).
    Ticks = 3,
    /// [`crate::ChangeMessage`].
    Change = 4,
    /// [`crate::Answer`].
    Answer = 5,
    /// [`crate::End`].
    End = 6,
    /// [`crate::Request`].
    Request = 16,
}

impl Kind {
    /// Kinds of this version of the protocol.
    const KNOWN: [Self; 7] =
        [Self::Greeting, Self::Run, Self::Ticks, Self::Change, Self::Answer, Self::End, Self::Request];

    /// Returns the kind of a byte; `None` for a kind of a later version of the protocol.
    fn of(byte: u8) -> Option<Self> {
        Self::KNOWN.into_iter().find(|kind| *kind as u8 == byte)
    }
}

/// Error of a frame with a payload above [`MAX_PAYLOAD`]: the other end uses another protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a frame of {length} bytes exceeds the limit of {MAX_PAYLOAD} bytes")]
pub struct LongFrame {
    /// Length in the frame's head, bytes.
    pub length: usize,
}

/// Encodes a message as a frame. `payload` must not exceed [`MAX_PAYLOAD`].
#[must_use]
pub fn frame(kind: Kind, payload: &[u8]) -> Vec<u8> {
    debug_assert!(payload.len() <= MAX_PAYLOAD);
    let length = u32::try_from(payload.len()).unwrap_or(u32::MAX);
    let mut bytes = Vec::with_capacity(HEAD + payload.len());
    bytes.extend(length.to_le_bytes());
    bytes.push(kind as u8);
    bytes.extend(payload);
    bytes
}

/// Decoder of frames from a stream of bytes.
#[derive(Debug, Default)]
pub struct Frames {
    bytes: Vec<u8>,
    taken: usize,
}

impl Frames {
    /// Reads the available bytes into the buffer; returns their number, 0 at the end of the stream.
    ///
    /// # Errors
    /// Errors of the reader, timeouts included; no received bytes are lost.
    pub fn fill(&mut self, reader: &mut impl Read) -> io::Result<usize> {
        let mut some = [0; 1 << 14];
        let count = reader.read(&mut some)?;
        self.push(&some[..count]);
        Ok(count)
    }

    /// Appends received bytes to the buffer.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.taken);
        self.taken = 0;
        self.bytes.extend(bytes);
    }

    /// Removes the next complete frame from the buffer; returns its kind and payload, `None` if more bytes are needed. Skips
    /// frames of kinds of a later version of the protocol.
    ///
    /// # Errors
    /// [`LongFrame`] for a frame that is too long; the rest of the stream cannot be decoded.
    pub fn take(&mut self) -> Result<Option<(Kind, &[u8])>, LongFrame> {
        while let Some((head, rest)) = self.bytes[self.taken..].split_first_chunk::<HEAD>() {
            let [a, b, c, d, kind] = *head;
            let length = usize::try_from(u32::from_le_bytes([a, b, c, d])).unwrap_or(usize::MAX);
            if length > MAX_PAYLOAD {
                return Err(LongFrame { length });
            }
            let Some(payload) = rest.get(..length) else { break };
            self.taken += HEAD + length;
            if let Some(kind) = Kind::of(kind) {
                return Ok(Some((kind, payload)));
            }
        }
        Ok(None)
    }
}

/// Encodes the payload of a frame of ticks: number of records dropped so far, and the records.
#[must_use]
pub fn ticks_to_payload<'a>(dropped: u64, records: impl ExactSizeIterator<Item = &'a TickRecord>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 + RECORD * records.len());
    bytes.extend(dropped.to_le_bytes());
    for record in records {
        bytes.extend(record.to_words().iter().flat_map(|word| word.to_le_bytes()));
    }
    bytes
}

/// Decodes the payload of a frame of ticks: number of records dropped so far, and the records. An incomplete record at the end is
/// ignored.
#[must_use]
pub fn ticks_from_payload(payload: &[u8]) -> (u64, Vec<TickRecord>) {
    let word = |bytes: &[u8]| u64::from_le_bytes(std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(0)));
    let (dropped, records) = payload.split_at(payload.len().min(8));
    let record = |bytes: &[u8]| {
        TickRecord::from_words(&std::array::from_fn(|i| word(bytes.get(8 * i..).unwrap_or(&[]))))
    };
    (word(dropped), records.chunks_exact(RECORD).map(record).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(number: u64) -> TickRecord {
        TickRecord::from_words(&std::array::from_fn(|i| 0x3ff0_0000_0000_0000 + number * 1000 + i as u64))
    }

    #[test]
    fn frames_survive_any_cut() {
        let records = [record(1), record(2)];
        let stream: Vec<u8> = [
            frame(Kind::Answer, b"{}"),
            vec![2, 0, 0, 0, 99, 7, 7], // of a later version of the protocol
            frame(Kind::Ticks, &ticks_to_payload(3, records.iter())),
        ]
        .concat();
        for cut in 0..stream.len() {
            let mut frames = Frames::default();
            let mut seen = Vec::new();
            for part in [&stream[..cut], &stream[cut..]] {
                frames.push(part);
                while let Some((kind, payload)) = frames.take().unwrap() {
                    seen.push((kind, payload.to_vec()));
                }
            }
            assert_eq!(seen.iter().map(|(kind, _)| *kind).collect::<Vec<_>>(), [Kind::Answer, Kind::Ticks]);
            assert_eq!(ticks_from_payload(&seen[1].1), (3, records.to_vec()));
        }
    }

    #[test]
    fn malformed_data_is_noticed_and_short_payloads_are_harmless() {
        let mut frames = Frames::default();
        frames.push(b"GET / HTTP/1.1\r\n");
        assert!(frames.take().is_err());
        assert_eq!(ticks_from_payload(b""), (0, Vec::new()));
        assert_eq!(ticks_from_payload(&[1; 100]).1, Vec::new());
    }
}
