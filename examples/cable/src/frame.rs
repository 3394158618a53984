//! Frames on the cable, four bytes each: type, 16-bit number (little-endian), and the sum of the three bytes before.

/// Type of a frame from the board, a thousand times a second: position, µm.
pub const POSITION: u8 = b'P';
/// Type of a frame to the board: force on the hand, mN.
pub const FORCE: u8 = b'F';
pub const BYTES: usize = 4;

pub fn encode(kind: u8, number: i16) -> [u8; BYTES] {
    let [low, high] = number.to_le_bytes();
    [kind, low, high, sum([kind, low, high])]
}

fn sum(bytes: [u8; 3]) -> u8 {
    bytes.into_iter().fold(0, u8::wrapping_add)
}

/// Decoder of frames of one type in a stream of bytes, also after a loss of bytes.
pub struct Decoder {
    kind: u8,
    last: [u8; BYTES],
}

impl Decoder {
    pub fn new(kind: u8) -> Self {
        Self { kind, last: [0; BYTES] }
    }

    /// Adds a byte; returns the number of the completed frame, `None` if the byte completes no frame.
    pub fn push(&mut self, byte: u8) -> Option<i16> {
        let [_, kind, low, high] = self.last;
        self.last = [kind, low, high, byte];
        let is_frame = kind == self.kind && byte == sum([kind, low, high]);
        is_frame.then(|| {
            self.last = [0; BYTES]; // no byte belongs to two frames
            i16::from_le_bytes([low, high])
        })
    }
}

#[test]
fn frames_are_found_after_a_loss() {
    let mut decoder = Decoder::new(POSITION);
    let stream = [&encode(POSITION, -300)[1..], &encode(FORCE, 7), &encode(POSITION, 12_345)].concat();
    let found: Vec<i16> = stream.into_iter().filter_map(|byte| decoder.push(byte)).collect();
    assert_eq!(found, [12_345]);
}
