//! Frames: requests, replies, and their encoding in 64 bytes. Little endian, SI units, `f32`.
//!
//! ```text
//!  0 magic u16   2 version u8   3 kind u8   4 sequence u32   8 acknowledged u32   12 time_us u32
//! 16 word u16   18 word u16    20 payload, 36 bytes          56 session u32       60 CRC-32 of bytes 0..60
//! ```

use super::codec::{FRAME_BYTES, Reader, Writer};
use super::description::Page;
use super::rejection::Rejection;

/// First two bytes of a frame from the host, "ML".
const REQUEST_MAGIC: u16 = u16::from_le_bytes(*b"ML");
/// First two bytes of a frame from the controller, "MS".
const ANSWER_MAGIC: u16 = u16::from_le_bytes(*b"MS");
/// Offset of the payload.
const PAYLOAD: usize = 20;

/// Request from the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Request for a page of the description.
    Describe {
        /// Number of the page, from 0.
        page: u16,
    },
    /// Start of a session. The coils stay off.
    Arm {
        /// Time between two commands, µs.
        period_us: u32,
        /// Watchdog timeout: longest time without a request before the controller holds, µs.
        watchdog_us: u32,
    },
    /// Start of levitation; commands are accepted from then on.
    TakeOff,
    /// Wrench on the hand: force in N, torque in N·m.
    Command {
        /// Force along x, y, z, then torque about x, y, z.
        wrench: [f32; 6],
        /// Validity, µs; after that the controller only damps until the next command.
        valid_us: u16,
    },
    /// Landing, then disarming.
    Land,
    /// Coils off at once; clears a fault.
    Disarm,
}

/// Request from the host, with its envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequestFrame {
    /// Sequence number, incremented with every frame.
    pub sequence: u32,
    /// Sequence number of the newest reply received by the host; 0 before the first.
    pub acknowledged: u32,
    /// The host's clock, µs, wrapping.
    pub time_us: u32,
    /// Session number chosen by the host when arming; requests of another session are rejected, except `Describe`.
    pub session: u32,
    /// Request, the payload of the frame.
    pub request: Request,
}

/// Mode of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Coils off.
    Disarmed = 0,
    /// Armed for a session; coils off.
    Armed = 1,
    /// Executing the commands of the host.
    Levitating = 2,
    /// Damping the flotor without commands after the watchdog timeout; then the controller lands.
    Holding = 3,
    /// Setting the flotor down.
    Landing = 4,
    /// Coils off; only a disarm is accepted.
    Fault = 5,
}

impl Mode {
    /// All modes, by code.
    const ALL: [Self; 6] =
        [Self::Disarmed, Self::Armed, Self::Levitating, Self::Holding, Self::Landing, Self::Fault];
}

/// Faults and active limits of the controller, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition(u16);

impl Condition {
    /// No fault and no active limit.
    pub const NONE: Self = Self(0);
    /// The controller received no request within the watchdog timeout.
    pub const WATCHDOG: Self = Self(1);
    /// The link to the host broke.
    pub const LINK_LOST: Self = Self(1 << 1);
    /// The flotor left the sensors' range.
    pub const SENSOR_RANGE: Self = Self(1 << 2);
    /// A coil carried too much current for too long.
    pub const OVERLOAD: Self = Self(1 << 3);
    /// A coil is too hot.
    pub const OVER_TEMPERATURE: Self = Self(1 << 4);
    /// The flotor moved too fast.
    pub const OVER_SPEED: Self = Self(1 << 5);
    /// The flotor was leaving the sensors' range; the controller lands.
    pub const EDGE: Self = Self(1 << 6);
    /// The command exceeded the largest wrench or slew rate and was limited. No fault.
    pub const LIMITED: Self = Self(1 << 8);
    /// The controller's own wall exerts a force. No fault.
    pub const BOUNDARY: Self = Self(1 << 9);
    /// The command has expired; the controller only damps until the next command. No fault.
    pub const EXPIRED: Self = Self(1 << 10);

    const FAULTS: u16 = 0x00ff;
    const KNOWN: u16 = 0x077f;

    /// Returns the union of two conditions.
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns true if all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns the faults without the active limits.
    pub const fn faults(self) -> Self {
        Self(self.0 & Self::FAULTS)
    }

    /// Returns true if no fault and no active limit is set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl std::fmt::Display for Condition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const WORDS: [(Condition, &str); 10] = [
            (Condition::WATCHDOG, "watchdog"),
            (Condition::LINK_LOST, "link-lost"),
            (Condition::SENSOR_RANGE, "sensor-range"),
            (Condition::OVERLOAD, "overload"),
            (Condition::OVER_TEMPERATURE, "over-temperature"),
            (Condition::OVER_SPEED, "over-speed"),
            (Condition::EDGE, "edge"),
            (Condition::LIMITED, "limited"),
            (Condition::BOUNDARY, "boundary"),
            (Condition::EXPIRED, "expired"),
        ];
        let mut words = WORDS.iter().filter(|(condition, _)| self.contains(*condition)).map(|(_, word)| word);
        f.write_str(words.next().map_or("none", |word| word))?;
        words.try_for_each(|word| write!(f, ",{word}"))
    }
}

/// Newest sample and mode of the controller, the reply to most requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Mode of the controller.
    pub mode: Mode,
    /// Faults and active limits.
    pub condition: Condition,
    /// Position of the handle, m.
    pub position_m: [f32; 3],
    /// Orientation of the handle: vector part of its unit quaternion, with the sign chosen for a non-negative scalar
    /// part.
    pub rotation_xyz: [f32; 3],
    /// Velocity, in steps of [`Status::VELOCITY_STEP_M_PER_S`].
    pub velocity_steps: [i16; 3],
    /// Angular velocity, in steps of [`Status::SPIN_STEP_RAD_PER_S`].
    pub spin_steps: [i16; 3],
}

impl Status {
    /// Resolution of a velocity, m/s: the range of ±3.2 m/s is beyond any hand.
    pub const VELOCITY_STEP_M_PER_S: f64 = 1.0e-4;
    /// Resolution of an angular velocity, rad/s: the range is ±32 rad/s.
    pub const SPIN_STEP_RAD_PER_S: f64 = 1.0e-3;
}

/// Reply of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Status, the reply to all requests but `Describe`.
    Status(Status),
    /// Page of the description, the reply to `Describe`.
    Description(Page),
}

/// Reply of the controller, with its envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnswerFrame {
    /// Sequence number, incremented with every reply.
    pub sequence: u32,
    /// Sequence number of the answered request.
    pub acknowledged: u32,
    /// The controller's clock when the sample was taken, µs, wrapping.
    pub time_us: u32,
    /// Current session of the controller; 0: none.
    pub session: u32,
    /// Reply, the payload of the frame.
    pub answer: Answer,
}

impl RequestFrame {
    /// Encodes the frame as the bytes of one packet, with header and checksum.
    #[must_use]
    pub fn encode(&self) -> [u8; FRAME_BYTES] {
        let mut bytes =
            Writer::new(REQUEST_MAGIC, self.sequence, self.acknowledged, self.time_us, self.session);
        match self.request {
            Request::Command { wrench, valid_us } => {
                bytes.kind(1).word(18, valid_us).floats(PAYLOAD, &wrench)
            }
            Request::Describe { page } => bytes.kind(2).word(16, page),
            Request::Arm { period_us, watchdog_us } => {
                bytes.kind(3).double(PAYLOAD, period_us).double(PAYLOAD + 4, watchdog_us)
            }
            Request::TakeOff => bytes.kind(4),
            Request::Land => bytes.kind(5),
            Request::Disarm => bytes.kind(6),
        };
        bytes.finish()
    }

    /// Decodes a frame; rejects any other bytes. Never panics.
    ///
    /// # Errors
    /// [`Rejection`], the first reason found.
    pub fn decode(bytes: &[u8]) -> Result<Self, Rejection> {
        let bytes = Reader::new(bytes, REQUEST_MAGIC)?;
        let request = match bytes.kind() {
            1 => Request::Command { wrench: bytes.floats(PAYLOAD)?, valid_us: bytes.word(18) },
            2 => Request::Describe { page: bytes.word(16) },
            3 => Request::Arm { period_us: bytes.double(PAYLOAD), watchdog_us: bytes.double(PAYLOAD + 4) },
            4 => Request::TakeOff,
            5 => Request::Land,
            6 => Request::Disarm,
            _ => return Err(Rejection::Kind),
        };
        let [sequence, acknowledged, time_us, session] = bytes.envelope();
        Ok(Self { sequence, acknowledged, time_us, session, request })
    }
}

impl AnswerFrame {
    /// Encodes the frame as the bytes of one packet, with header and checksum.
    #[must_use]
    pub fn encode(&self) -> [u8; FRAME_BYTES] {
        let mut bytes =
            Writer::new(ANSWER_MAGIC, self.sequence, self.acknowledged, self.time_us, self.session);
        match &self.answer {
            Answer::Status(status) => {
                bytes.kind(0x81).word(16, status.mode as u16).word(18, status.condition.0);
                bytes.floats(PAYLOAD, &status.position_m).floats(32, &status.rotation_xyz);
                bytes.steps(44, status.velocity_steps).steps(50, status.spin_steps);
            }
            Answer::Description(page) => {
                bytes.kind(0x82).word(16, page.number());
                page.write(&mut bytes);
            }
        }
        bytes.finish()
    }

    /// Decodes a frame; rejects any other bytes. Never panics.
    ///
    /// # Errors
    /// [`Rejection`], the first reason found.
    pub fn decode(bytes: &[u8]) -> Result<Self, Rejection> {
        let bytes = Reader::new(bytes, ANSWER_MAGIC)?;
        let answer = match bytes.kind() {
            0x81 => {
                let condition = bytes.word(18);
                if condition & !Condition::KNOWN != 0 {
                    return Err(Rejection::Kind);
                }
                Answer::Status(Status {
                    mode: *Mode::ALL.get(usize::from(bytes.word(16))).ok_or(Rejection::Kind)?,
                    condition: Condition(condition),
                    position_m: bytes.floats(PAYLOAD)?,
                    rotation_xyz: bytes.floats(32)?,
                    velocity_steps: bytes.steps(44),
                    spin_steps: bytes.steps(50),
                })
            }
            0x82 => Answer::Description(Page::read(bytes.word(16), &bytes)?),
            _ => return Err(Rejection::Kind),
        };
        let [sequence, acknowledged, time_us, session] = bytes.envelope();
        Ok(Self { sequence, acknowledged, time_us, session, answer })
    }
}
