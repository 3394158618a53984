//! Assembly of whole frames from a byte stream, for any segmentation of the stream.

use super::frame::{LONGEST_BYTES, SHORTEST_BYTES};
use std::io::{ErrorKind, Read};

/// Result of one read of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadResult {
    /// A whole frame of this many bytes; [`Intake::frame`] returns the frame until the next read.
    Frame(usize),
    /// No whole frame yet.
    Nothing,
    /// An invalid length: the start of the next frame is unknown.
    Malformed,
    /// The connection is lost.
    Lost,
}

/// Receive buffer that assembles whole frames.
#[derive(Clone, Debug)]
pub struct Intake {
    bytes: [u8; LONGEST_BYTES],
    filled: usize,
    /// Bytes of the frame returned last; discarded by the next read.
    returned: usize,
}

impl Default for Intake {
    fn default() -> Self {
        Self { bytes: [0; LONGEST_BYTES], filled: 0, returned: 0 }
    }
}

impl Intake {
    /// Returns the frame found by the last [`Intake::take`].
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        self.bytes.get(..self.returned).unwrap_or_default()
    }

    /// Reads the next frame of a stream, until the frame is complete or the stream has no more data. Bounded on a
    /// non-blocking stream: reads at most [`LONGEST_BYTES`].
    pub fn take(&mut self, stream: &mut impl Read) -> ReadResult {
        self.bytes.copy_within(self.returned..self.filled, 0);
        self.filled -= self.returned;
        self.returned = 0;
        loop {
            match self.length() {
                Some(Err(())) => return ReadResult::Malformed,
                Some(Ok(length)) if length <= self.filled => {
                    self.returned = length;
                    return ReadResult::Frame(length);
                }
                _ => {}
            }
            let room = self.bytes.get_mut(self.filled..).unwrap_or_default();
            match stream.read(room) {
                Ok(0) => return ReadResult::Lost,
                Ok(read) => self.filled += read,
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return ReadResult::Nothing,
                    ErrorKind::Interrupted => {}
                    _ => return ReadResult::Lost,
                },
            }
        }
    }

    /// Returns true if bytes after the last returned frame have arrived.
    #[must_use]
    pub fn has_partial_frame(&self) -> bool {
        self.filled > self.returned
    }

    /// Returns the length of the frame at the start of the buffer; an error if the length is invalid.
    fn length(&self) -> Option<Result<usize, ()>> {
        let head = self.bytes.get(..self.filled)?.first_chunk()?;
        let length = usize::try_from(i32::from_le_bytes(*head)).unwrap_or(0);
        Some(if (SHORTEST_BYTES..=LONGEST_BYTES).contains(&length) { Ok(length) } else { Err(()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives its pieces one at a time, and then nothing.
    struct Pieces(Vec<Vec<u8>>);

    impl Read for Pieces {
        fn read(&mut self, room: &mut [u8]) -> std::io::Result<usize> {
            if self.0.is_empty() {
                return Err(ErrorKind::WouldBlock.into());
            }
            self.0.remove(0).as_slice().read(room)
        }
    }

    #[test]
    fn frames_come_whole_from_single_bytes_and_from_one_piece() {
        let frames = [[8, 0, 0, 0, 1, 0, 0, 0].to_vec(), [12, 0, 0, 0, 2, 0, 0, 0, 9, 9, 9, 9].to_vec()];
        let all: Vec<u8> = frames.concat();
        for mut stream in [Pieces(all.iter().map(|byte| vec![*byte]).collect()), Pieces(vec![all.clone()])] {
            let mut intake = Intake::default();
            for frame in &frames {
                assert_eq!(intake.take(&mut stream), ReadResult::Frame(frame.len()));
                assert_eq!(intake.frame(), frame);
            }
            assert_eq!(intake.take(&mut stream), ReadResult::Nothing);
            assert!(!intake.has_partial_frame());
        }
    }

    #[test]
    fn a_length_that_no_frame_has_is_told() {
        for length in [0_i32, 7, -1, 513, i32::MIN] {
            let mut stream = Pieces(vec![length.to_le_bytes().to_vec()]);
            assert_eq!(Intake::default().take(&mut stream), ReadResult::Malformed, "{length}");
        }
        let mut half = Intake::default();
        assert_eq!(half.take(&mut Pieces(vec![vec![12, 0, 0, 0, 1]])), ReadResult::Nothing);
        assert!(half.has_partial_frame());
        assert_eq!(half.take(&mut [].as_slice()), ReadResult::Lost);
    }
}
