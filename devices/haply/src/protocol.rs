//! Serial protocol of the board: requests and replies as bytes. No I/O here.
//!
//! ```text
//! request  [kind u8][device u8][bytes ...][f32 little-endian ...]
//! answer   [device u8][f32 little-endian ...]                        to a request for torques only
//! ```
//!
//! Messages have no length, no checksum and no delimiter (hAPI, Haply Robotics 2018 and later: `Board`, `Device`). A
//! lost byte shifts all later bytes; a host therefore has one request in flight and discards a partial reply after a
//! timeout ([`crate::board`]). Numbers are in the order of the ports, and motor 1 of the pantograph is on port 2.

/// Device number of the pantograph on its board, as in the maker's examples.
pub const DEVICE: u8 = 5;
/// Bytes of a reply: the device number and two angles.
pub const ANSWER_BYTES: usize = 1 + 2 * 4;
/// Bytes of a request for torques.
pub const TORQUES_BYTES: usize = 2 + 2 * 4;
/// Bytes of the request that sets up two motors and two encoders.
pub const SETUP_BYTES: usize = 2 + 3 + 3 + 2 + 4 * 4;
/// Request that clears the configuration of the board.
pub const RESET: [u8; 2] = [0, 0];

const SETUP: u8 = 1;
const TORQUES: u8 = 2;
/// Bit mask of the ports in use, 1 and 2.
const BOTH_PORTS: u8 = 0b11;
/// Limit of plausible angles, °: the arms cannot turn round.
const LARGEST_DEG: f64 = 720.0;

/// Positive direction of a motor or an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Clockwise.
    Clockwise = 0,
    /// Counterclockwise.
    Counterclockwise = 1,
}

/// Configuration of one arm: directions, start angle and encoder resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Direction of the motor for a positive torque.
    pub motor: Direction,
    /// Counting direction of the encoder.
    pub encoder: Direction,
    /// Angle of the arm at the rest position, where the handle must be while the board starts, °.
    pub start_deg: f32,
    /// Encoder counts per turn.
    pub counts_per_turn: f32,
}

/// Encodes the request that configures both arms. Not real-time.
#[must_use]
pub fn setup(arms: &[Arm; 2]) -> [u8; SETUP_BYTES] {
    let [first, second] = arms;
    let ports = [second, first];
    let [a, b] = ports;
    let mut bytes = [0; SETUP_BYTES];
    let head = [
        SETUP,
        DEVICE,
        BOTH_PORTS,
        a.motor as u8,
        b.motor as u8,
        BOTH_PORTS,
        a.encoder as u8,
        b.encoder as u8,
        0, // analogue inputs
        0, // pulse outputs
    ];
    let numbers = ports.into_iter().flat_map(|arm| [arm.start_deg, arm.counts_per_turn]);
    put(&mut bytes, &head, numbers);
    bytes
}

/// Encodes the request for torques of the first and the second arm, N·m. Real-time: bounded, no allocation.
#[must_use]
pub fn torques(torques_nm: [f32; 2]) -> [u8; TORQUES_BYTES] {
    let [first, second] = torques_nm;
    let mut bytes = [0; TORQUES_BYTES];
    put(&mut bytes, &[TORQUES, DEVICE], [second, first].into_iter());
    bytes
}

fn put(bytes: &mut [u8], head: &[u8], numbers: impl Iterator<Item = f32>) {
    let tail = numbers.flat_map(f32::to_le_bytes);
    bytes.iter_mut().zip(head.iter().copied().chain(tail)).for_each(|(place, byte)| *place = byte);
}

/// Request as received by a board: the inverse of [`setup`] and [`torques`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Request to clear the configuration.
    Reset,
    /// Request to configure the first and the second arm.
    Setup([Arm; 2]),
    /// Request to exert torques on the first and the second arm, N·m, and to reply.
    Torques([f32; 2]),
}

impl Request {
    /// Parses the first request in a buffer; returns the request and its length, `None` while it is incomplete.
    ///
    /// # Errors
    /// The number of bytes at the start of the buffer that belong to no request.
    pub fn parse(bytes: &[u8]) -> Result<Option<(Self, usize)>, usize> {
        let number = |at: usize| {
            let four = bytes.get(at..at + 4).and_then(|four| four.try_into().ok());
            four.map(f32::from_le_bytes)
        };
        let direction = |at: usize| match bytes.get(at) {
            Some(0) => Direction::Clockwise,
            _ => Direction::Counterclockwise,
        };
        match bytes {
            [] | [_] => Ok(None),
            [0, 0, ..] => Ok(Some((Self::Reset, RESET.len()))),
            [SETUP, DEVICE, ..] => {
                let arm = |port: usize| {
                    Some(Arm {
                        motor: direction(3 + port),
                        encoder: direction(6 + port),
                        start_deg: number(10 + 8 * port)?,
                        counts_per_turn: number(14 + 8 * port)?,
                    })
                };
                let arms = arm(1).zip(arm(0));
                Ok(arms.map(|(first, second)| (Self::Setup([first, second]), SETUP_BYTES)))
            }
            [TORQUES, DEVICE, ..] => {
                let arms = number(6).zip(number(2));
                Ok(arms.map(|(first, second)| (Self::Torques([first, second]), TORQUES_BYTES)))
            }
            _ => Err(1),
        }
    }
}

/// Encodes the reply to a request for torques: angles of the first and the second arm, °.
#[must_use]
pub fn answer(angles_deg: [f32; 2]) -> [u8; ANSWER_BYTES] {
    let [first, second] = angles_deg;
    let mut bytes = [0; ANSWER_BYTES];
    put(&mut bytes, &[DEVICE], [second, first].into_iter());
    bytes
}

/// Result of a received byte.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parsed {
    /// Completed reply: angles of the first and the second arm, °.
    Angles([f64; 2]),
    /// Malformed data that belongs to no reply.
    Noise,
    /// Part of an incomplete reply.
    Part,
}

/// Parser that assembles replies byte by byte.
#[derive(Clone, Debug, Default)]
pub struct Answers {
    bytes: [u8; ANSWER_BYTES],
    length: usize,
}

impl Answers {
    /// Parses the next byte. Real-time: bounded, no allocation.
    pub fn push(&mut self, byte: u8) -> Parsed {
        if self.length == 0 && byte != DEVICE {
            return Parsed::Noise;
        }
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
        if self.length < ANSWER_BYTES {
            return Parsed::Part;
        }
        self.length = 0;
        let [_, a, b, c, d, e, f, g, h] = self.bytes;
        let [second, first] = [[a, b, c, d], [e, f, g, h]].map(|four| f64::from(f32::from_le_bytes(four)));
        let angles = [first, second];
        // False for NaN.
        if angles.iter().all(|angle| angle.abs() <= LARGEST_DEG) {
            Parsed::Angles(angles)
        } else {
            Parsed::Noise
        }
    }

    /// Discards an incomplete reply. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        self.length = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parsed(bytes: &[u8]) -> Vec<Parsed> {
        let mut answers = Answers::default();
        bytes.iter().map(|byte| answers.push(*byte)).filter(|parsed| *parsed != Parsed::Part).collect()
    }

    #[test]
    fn requests_are_the_bytes_of_the_makers_library() {
        // What its example for the second hardware makes: motors and encoders 1 on port 2, 2 on port 1.
        let arms = [
            Arm {
                motor: Direction::Counterclockwise,
                encoder: Direction::Counterclockwise,
                start_deg: 241.0,
                counts_per_turn: 10752.0,
            },
            Arm {
                motor: Direction::Clockwise,
                encoder: Direction::Clockwise,
                start_deg: -61.0,
                counts_per_turn: 10752.0,
            },
        ];
        let numbers = [-61.0_f32, 10752.0, 241.0, 10752.0].map(f32::to_le_bytes).concat();
        let expected: Vec<u8> = [1, 5, 3, 0, 1, 3, 0, 1, 0, 0].into_iter().chain(numbers).collect();
        assert_eq!(setup(&arms).to_vec(), expected);
        let expected: Vec<u8> =
            [2, 5].into_iter().chain([0.25_f32, -0.5].map(f32::to_le_bytes).concat()).collect();
        assert_eq!(torques([-0.5, 0.25]).to_vec(), expected);
        assert_eq!(Request::parse(&setup(&arms)), Ok(Some((Request::Setup(arms), SETUP_BYTES))));
    }

    #[test]
    fn answers_arrive_in_pieces_and_after_noise() {
        let bytes =
            [&[7, 0][..], &answer([90.0, 12.5]), &answer([f32::NAN, 0.0]), &answer([1.0, 2.0])].concat();
        let angles = |first, second| Parsed::Angles([first, second]);
        assert_eq!(
            parsed(&bytes),
            [Parsed::Noise, Parsed::Noise, angles(90.0, 12.5), Parsed::Noise, angles(1.0, 2.0)]
        );
    }

    proptest! {
        #[test]
        fn any_bytes_give_finite_angles_or_noise(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            for one in parsed(&bytes) {
                if let Parsed::Angles(angles) = one {
                    prop_assert!(angles.iter().all(|angle| angle.abs() <= LARGEST_DEG));
                }
            }
        }

        #[test]
        fn any_bytes_are_requests_or_none(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut rest = &bytes[..];
            loop {
                match Request::parse(rest) {
                    Ok(Some((_, length))) => rest = &rest[length..],
                    Err(length) => rest = &rest[length..],
                    Ok(None) => break,
                }
            }
            prop_assert!(rest.len() < SETUP_BYTES);
        }

        #[test]
        fn what_is_said_is_what_is_heard(first in -700.0_f32..700.0, second in -700.0_f32..700.0) {
            prop_assert_eq!(parsed(&answer([first, second])), [Parsed::Angles([first.into(), second.into()])]);
            let request = Request::parse(&torques([first, second]));
            prop_assert_eq!(request, Ok(Some((Request::Torques([first, second]), TORQUES_BYTES))));
        }
    }
}
