//! Coded frames on any non-blocking byte stream.

use super::{Incoming, LinkLost, Transport};
use crate::protocol::FRAME_BYTES;
use crate::protocol::stream::{CODED_BYTES, Received, StreamDecoder, coded};
use std::io::{ErrorKind, Read, Write};

/// Size of the read buffer, bytes: a few frames.
const CHUNK_BYTES: usize = 256;
/// Maximum number of reads per call: another end that sends bytes without a packet must not hold the tick.
const MOST_READS: u32 = 2;

/// Link over a non-blocking byte stream: a read or write without progress must return `WouldBlock` or `TimedOut`.
#[derive(Debug)]
pub struct StreamLink<S> {
    stream: S,
    decoder: StreamDecoder,
    chunk: [u8; CHUNK_BYTES],
    /// Range of the chunk not yet decoded.
    fresh: std::ops::Range<usize>,
    /// Frame in transmission, with the range not yet written.
    pending: [u8; CODED_BYTES],
    left: std::ops::Range<usize>,
}

impl<S: Read + Write + Send> StreamLink<S> {
    /// Creates a link over a non-blocking stream.
    pub fn new(stream: S) -> Self {
        Self {
            stream,
            decoder: StreamDecoder::default(),
            chunk: [0; CHUNK_BYTES],
            fresh: 0..0,
            pending: [0; CODED_BYTES],
            left: 0..0,
        }
    }

    /// Returns true if the other end is open; may read received bytes into the buffer of the link.
    pub fn is_open(&mut self) -> bool {
        !self.fresh.is_empty() || self.fill().is_ok()
    }

    /// Reads bytes into the empty chunk; returns true if there were any.
    fn fill(&mut self) -> Result<bool, LinkLost> {
        loop {
            match self.stream.read(&mut self.chunk) {
                Ok(0) => return Err(LinkLost),
                Ok(length) => {
                    self.fresh = 0..length;
                    return Ok(true);
                }
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(false),
                    ErrorKind::Interrupted => {}
                    _ => return Err(LinkLost),
                },
            }
        }
    }

    /// Writes the rest of the pending frame; returns true if the frame is complete.
    fn flush(&mut self) -> Result<bool, LinkLost> {
        while let Some(bytes) = self.pending.get(self.left.clone()).filter(|bytes| !bytes.is_empty()) {
            match self.stream.write(bytes) {
                Ok(0) => return Err(LinkLost),
                Ok(written) => self.left.start += written,
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(false),
                    ErrorKind::Interrupted => {}
                    _ => return Err(LinkLost),
                },
            }
        }
        Ok(true)
    }
}

impl<S: Read + Write + Send> Transport for StreamLink<S> {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        // A partial frame must be completed first, or the other end loses the next one too.
        if self.flush()? {
            let length;
            (self.pending, length) = coded(frame);
            self.left = 0..length;
            self.flush()?;
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        for read in 0..=MOST_READS {
            for index in self.fresh.by_ref() {
                let byte = self.chunk.get(index).copied().unwrap_or(0);
                match self.decoder.push(byte) {
                    Some(Received::Packet(packet)) => return Ok(Incoming::Packet(packet)),
                    Some(Received::Malformed) => return Ok(Incoming::Malformed),
                    None => {}
                }
            }
            if read == MOST_READS || !self.fill()? {
                break;
            }
        }
        Ok(Incoming::Nothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::stream::coded;

    /// Stream that delivers one byte again and again, then some frames, and counts its reads.
    struct Flood {
        byte: u8,
        left: u32,
        frame: Vec<u8>,
        reads: u32,
    }

    impl Read for Flood {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            self.reads += 1;
            if self.left > 0 {
                self.left -= 1;
                buffer.fill(self.byte);
                return Ok(buffer.len());
            }
            let length = self.frame.len().min(buffer.len());
            if length == 0 {
                return Err(ErrorKind::WouldBlock.into());
            }
            for (slot, byte) in buffer.iter_mut().zip(self.frame.drain(..length)) {
                *slot = byte;
            }
            Ok(length)
        }
    }

    impl Write for Flood {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn bytes_without_a_packet_end_a_call_after_few_reads() {
        for byte in [0, 7] {
            let (frame, length) = coded(&[9; FRAME_BYTES]);
            let frame = [&[0], &frame[..length]].concat();
            let mut link = StreamLink::new(Flood { byte, left: 1000, frame, reads: 0 });
            let mut packet = None;
            for _ in 0..1000 {
                let before = link.stream.reads;
                let incoming = link.receive().expect("the stream is open");
                assert!(link.stream.reads - before <= MOST_READS, "{byte}");
                if let Incoming::Packet(received) = incoming {
                    packet = Some(received);
                    break;
                }
            }
            assert_eq!(packet, Some([9; FRAME_BYTES]), "{byte}");
        }
    }
}
