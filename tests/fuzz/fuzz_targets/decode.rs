//! Any bytes give frames or reasons, never a panic; an accepted frame is the same after encoding and decoding.
#![no_main]

use flotor_maglev::protocol::stream::StreamDecoder;
use flotor_maglev::protocol::{AnswerFrame, RequestFrame};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut stream = StreamDecoder::default();
    for byte in bytes {
        let _ = stream.push(*byte);
    }
    let mut frame = bytes.to_vec();
    // A valid checksum: without it every frame is rejected here.
    if frame.len() == 64 {
        let checksum = crc32_of(&frame[..60]).to_le_bytes();
        frame[60..].copy_from_slice(&checksum);
    }
    if let Ok(request) = RequestFrame::decode(&frame) {
        assert_eq!(RequestFrame::decode(&request.encode()), Ok(request));
    }
    if let Ok(answer) = AnswerFrame::decode(&frame) {
        assert_eq!(AnswerFrame::decode(&answer.encode()), Ok(answer));
    }
});

/// CRC-32 bit by bit: slow, short, and another implementation than the one under test.
fn crc32_of(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}
