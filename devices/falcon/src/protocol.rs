//! Commands and reports of the firmware: frames of 16 bytes, one report per command. No I/O here.
//!
//! ```text
//! command  '<'  3 motors x 4 nibbles    lamps   'A'     '>'
//! report   '<'  3 encoders x 4 nibbles  inputs  (any)   '>'
//! ```
//!
//! Every number is sent as 0x41 plus a few bits, so that no number contains `<` or `>`. Words have 16 bits, two's
//! complement, the lowest nibble first (libnifalcon, firmware "nvent").

/// Bytes of a frame.
pub const FRAME_BYTES: usize = 16;
const START: u8 = b'<';
const END: u8 = b'>';
/// Offset added to the bits of a number.
const OFFSET: u8 = 0x41;
/// Offsets of the lamps or inputs, of the unused byte and of the last one.
const INPUTS: usize = 13;
const FREE: usize = 14;
const LAST: usize = FRAME_BYTES - 1;
/// Limit on the magnitude of a motor word.
pub const MOST_WORD: i16 = 4095;

/// Colour of the ring around the handle's arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// No light.
    Off = 0,
    /// Green: force is possible.
    Green = 2,
    /// Blue: at rest.
    Blue = 4,
    /// Red: the device must be homed.
    Red = 8,
}

/// Homing bit of a command; if set, the firmware searches for the ends of the arms' ranges, from which its encoder counts start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homing {
    /// No homing requested.
    Done = 0,
    /// Homing requested.
    Wanted = 1,
}

/// Command to the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// Motor words, one torque per arm, at most [`MOST_WORD`] in magnitude; a positive word acts towards smaller
    /// angles.
    pub motors: [i16; 3],
    /// Colour of the lamp.
    pub lamp: Lamp,
    /// Homing bit.
    pub homing: Homing,
}

/// Report of the firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Encoder counts, one per arm.
    pub encoders: [i16; 3],
    /// Buttons of the grip: plus, forward, centre, minus from bit 0.
    pub buttons: u32,
    /// Homed arms, one bit each.
    pub homed: u8,
}

/// Value of [`Report::homed`] with all arms homed.
pub const ALL_HOMED: u8 = 0b111;

impl Command {
    /// Command of zero torque, with a blue lamp and without homing.
    pub const REST: Self = Self { motors: [0; 3], lamp: Lamp::Blue, homing: Homing::Done };

    /// Encodes the command. Real-time: bounded, no allocation.
    #[must_use]
    pub fn bytes(&self) -> [u8; FRAME_BYTES] {
        frame(self.motors, self.lamp as u8 | self.homing as u8, OFFSET)
    }

    /// Decodes a command; `None` for an invalid lamp byte. Real-time: bounded, no allocation.
    #[must_use]
    pub fn read(bytes: &[u8; FRAME_BYTES]) -> Option<Self> {
        let (motors, bits) = (words(bytes), bytes[INPUTS].checked_sub(OFFSET)?);
        let lamp = match bits & !1 {
            0 => Lamp::Off,
            2 => Lamp::Green,
            4 => Lamp::Blue,
            8 => Lamp::Red,
            _ => return None,
        };
        let homing = if bits & 1 == 1 { Homing::Wanted } else { Homing::Done };
        Some(Self { motors, lamp, homing })
    }
}

impl Report {
    /// Encodes this report as the firmware does. Real-time: bounded, no allocation.
    #[must_use]
    pub fn bytes(&self) -> [u8; FRAME_BYTES] {
        #[allow(clippy::cast_possible_truncation)] // four bits
        let buttons = (self.buttons & 0xf) as u8;
        frame(self.encoders, buttons | (self.homed & ALL_HOMED) << 4, OFFSET)
    }

    /// Decodes a report from a frame that [`Frames`] has checked. Real-time: bounded, no allocation.
    #[must_use]
    pub fn read(bytes: &[u8; FRAME_BYTES]) -> Self {
        let bits = bytes[INPUTS].wrapping_sub(OFFSET);
        Self { encoders: words(bytes), buttons: u32::from(bits & 0xf), homed: bits >> 4 & ALL_HOMED }
    }
}

fn frame(words: [i16; 3], bits: u8, free: u8) -> [u8; FRAME_BYTES] {
    let mut bytes = [START; FRAME_BYTES];
    let places = bytes.iter_mut().skip(1);
    let nibbles = words.iter().flat_map(|word| {
        let [low, high] = word.to_le_bytes();
        [low & 0xf, low >> 4, high & 0xf, high >> 4]
    });
    places.zip(nibbles.chain([bits])).for_each(|(place, bits)| *place = OFFSET.wrapping_add(bits));
    (bytes[FREE], bytes[LAST]) = (free, END);
    bytes
}

/// Decodes the words of a frame that [`Frames`] has checked.
fn words(bytes: &[u8; FRAME_BYTES]) -> [i16; 3] {
    let nibble = |place: usize| bytes.get(place).map_or(0, |byte| byte.wrapping_sub(OFFSET) & 0xf);
    [1, 5, 9].map(|first| {
        let low = nibble(first) | nibble(first + 1) << 4;
        let high = nibble(first + 2) | nibble(first + 3) << 4;
        i16::from_le_bytes([low, high])
    })
}

/// Result of a received byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parsed {
    /// Completed frame.
    Frame([u8; FRAME_BYTES]),
    /// Part of an incomplete frame.
    Part,
    /// Malformed data: the byte and the bytes collected before belong to no frame.
    Noise,
}

/// Parser that assembles frames byte by byte.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frames {
    bytes: [u8; FRAME_BYTES],
    length: usize,
}

impl Frames {
    /// Parses the next byte; resynchronises after malformed data. Real-time: bounded, no allocation.
    pub fn push(&mut self, byte: u8) -> Parsed {
        let fits = match self.length {
            0 => byte == START,
            1..INPUTS => (OFFSET..OFFSET + 16).contains(&byte),
            INPUTS => (OFFSET..OFFSET + 128).contains(&byte),
            FREE => true,
            _ => byte == END,
        };
        if !fits {
            return self.begin_anew(byte);
        }
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
        }
        self.length += 1;
        if self.length < FRAME_BYTES {
            return Parsed::Part;
        }
        self.length = 0;
        Parsed::Frame(self.bytes)
    }

    /// Drops an incomplete frame. The byte may start the next one, and so may the unused byte before it.
    fn begin_anew(&mut self, byte: u8) -> Parsed {
        let was_free_start = self.length == LAST && self.bytes[FREE] == START;
        self.length = 0;
        if byte == START {
            (self.bytes[0], self.length) = (START, 1);
        } else if was_free_start && (OFFSET..OFFSET + 16).contains(&byte) {
            (self.bytes[0], self.bytes[1], self.length) = (START, byte, 2);
        }
        Parsed::Noise
    }
}

/// Rounds torques, in units of the motor words, to motor words. If a magnitude exceeds [`MOST_WORD`], all three torques are scaled
/// down by a common factor; if a torque is not finite, all three words are 0. Real-time: bounded, no allocation.
#[must_use]
pub fn clipped_words(wanted: [f64; 3]) -> Clipped {
    let most = f64::from(MOST_WORD);
    let largest = wanted.iter().fold(0.0_f64, |largest, word| largest.max(word.abs()));
    let is_finite = wanted.iter().all(|word| word.is_finite());
    let share = if largest > most { most / largest } else { 1.0 };
    let words = wanted.map(|word| {
        let word = if is_finite { (word * share).round().clamp(-most, most) } else { 0.0 };
        #[allow(clippy::cast_possible_truncation)] // 4095 at most
        let word = word as i16;
        word
    });
    Clipped { words, is_clipped: largest > most || !is_finite }
}

/// Motor words within the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clipped {
    /// Motor words, at most [`MOST_WORD`] in magnitude.
    pub words: [i16; 3],
    /// True if the words were scaled down, or the torques were not finite.
    pub is_clipped: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_are_the_bytes_of_the_firmware() {
        let command = Command { motors: [0x1234, -1, 4095], lamp: Lamp::Green, homing: Homing::Wanted };
        assert_eq!(&command.bytes(), b"<EDCBPPPPPPPADA>");
        assert_eq!(&Command::REST.bytes(), b"<AAAAAAAAAAAAEA>");
        let report = Report { encoders: [-1, 256, 3], buttons: 0b1001, homed: 0b111 };
        assert_eq!(&report.bytes(), b"<PPPPAABADAAA\xbaA>");
    }

    #[test]
    fn words_are_clipped_in_their_proportion_and_never_wrap() {
        let clipped = clipped_words([8190.0, -4095.0, 0.4]);
        assert_eq!((clipped.words, clipped.is_clipped), ([4095, -2048, 0], true));
        assert_eq!(clipped_words([300_000.0, 3.0, -300_000.0]).words, [4095, 0, -4095]);
        assert_eq!(clipped_words([f64::NAN, 1.0, 1.0]).words, [0; 3]);
        assert_eq!(clipped_words([f64::INFINITY, 1.0, 1.0]).words, [0; 3]);
        let exact = clipped_words([4095.0, -4095.0, 1.0]);
        assert_eq!((exact.words, exact.is_clipped), ([4095, -4095, 1], false));
    }

    /// Numbers without a pattern (splitmix64), so that a million frames need no strategy.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            mixed ^ mixed >> 31
        }
    }

    fn frames_of_this_run() -> usize {
        if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 1_000_000 } else { 20_000 }
    }

    /// Frames in packets of any length, behind status bytes, with noise between some of them: all of them come out, and no
    /// other.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // any bits will do
    #[test]
    fn frames_in_any_pieces_decode_with_none_wrong() {
        let mut numbers = Numbers(7);
        let (mut frames, mut expected, mut stream) = (Frames::default(), Vec::new(), Vec::new());
        for _ in 0..frames_of_this_run() {
            let bits = numbers.next();
            let encoders = [bits as i16, (bits >> 16) as i16, (bits >> 32) as i16];
            let report =
                Report { encoders, buttons: (bits >> 48 & 0xf) as u32, homed: (bits >> 52 & 7) as u8 };
            if bits >> 56 < 32 {
                // A piece of a frame, which the next one ends.
                let cut = 1 + (bits >> 60) as usize % 14;
                stream.extend(&report.bytes()[..cut]);
            }
            stream.extend(report.bytes());
            expected.push(report);
        }
        let (mut received, mut at) = (Vec::with_capacity(expected.len()), 0);
        while at < stream.len() {
            let length = 1 + (numbers.next() % 62) as usize;
            let mut packet = vec![0x01, 0x60];
            packet.extend(&stream[at..stream.len().min(at + length)]);
            at += length;
            crate::chip::payload(&packet, |byte| {
                if let Parsed::Frame(bytes) = frames.push(byte) {
                    received.push(Report::read(&bytes));
                }
            })
            .expect("it has its status");
        }
        assert!(received == expected, "{} frames of {}", received.len(), expected.len());
        println!("{} frames in random pieces, {} heard, none wrong", expected.len(), received.len());
    }

    proptest! {
        #[test]
        fn commands_and_reports_are_read_as_they_were(
            motors in any::<[i16; 3]>(), buttons in 0..16_u32, homed in 0..8_u8, colour in 0..4_usize
        ) {
            let lamp = [Lamp::Off, Lamp::Green, Lamp::Blue, Lamp::Red][colour];
            for homing in [Homing::Done, Homing::Wanted] {
                let command = Command { motors, lamp, homing };
                prop_assert_eq!(Command::read(&command.bytes()), Some(command));
            }
            let report = Report { encoders: motors, buttons, homed };
            prop_assert_eq!(Report::read(&report.bytes()), report);
        }

        /// After any bytes at all, two frames are enough to be in step again.
        #[test]
        fn noise_costs_a_frame_at_most(noise in prop::collection::vec(any::<u8>(), 0..100), motors in any::<[i16; 3]>()) {
            let mut frames = Frames::default();
            for byte in noise {
                let _ = frames.push(byte);
            }
            let report = Report { encoders: motors, buttons: 5, homed: 7 };
            let received: Vec<Parsed> = [report.bytes(), report.bytes()].concat().iter().map(|byte| frames.push(*byte)).collect();
            prop_assert_eq!(received.last(), Some(&Parsed::Frame(report.bytes())));
        }
    }
}
