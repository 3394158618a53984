//! Types of the fields in requests, replies and events.

use std::fmt;

/// A number for each axis: x, y, z, then the rotations about x, y, z.
pub type AxisValues = [f32; 6];

/// Returns the value of a code; `None` beyond the list, such as for the seventh axis, the grasp of other devices.
pub(super) fn of_code<T: Copy>(all: &[T], code: i32) -> Option<T> {
    all.get(usize::try_from(code).ok()?).copied()
}

/// Axis of translation or rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Translation along x.
    X = 0,
    /// Translation along y.
    Y = 1,
    /// Translation along z.
    Z = 2,
    /// Rotation about x.
    Rx = 3,
    /// Rotation about y.
    Ry = 4,
    /// Rotation about z.
    Rz = 5,
}

impl Axis {
    /// All axes, in protocol order.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Rx, Self::Ry, Self::Rz];
}

/// Gain set, by the state of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GainSet {
    /// Gains of a free axis.
    Normal = 0,
    /// Gains of a locked axis.
    Locked = 1,
    /// Gains of an axis beyond its constraint.
    Constrained = 2,
    /// Gains of all axes beyond the boundary sphere.
    Boundary = 3,
}

impl GainSet {
    /// All gain sets, in protocol order.
    pub const ALL: [Self; 4] = [Self::Normal, Self::Locked, Self::Constrained, Self::Boundary];
}

/// Kind of a gain in the controller of an axis (PID with feed-forward).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// Proportional gain.
    P = 0,
    /// Integral gain.
    I = 1,
    /// Derivative gain.
    D = 2,
    /// Feed-forward.
    Ff = 3,
}

impl Gain {
    /// All kinds of gains, in protocol order.
    pub const ALL: [Self; 4] = [Self::P, Self::I, Self::D, Self::Ff];
}

/// Gains of a translational or rotational axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pid {
    /// Proportional gain, N/m or N·m/rad.
    pub p: f32,
    /// Integral gain, N/(m s) or N·m/(rad s).
    pub i: f32,
    /// Derivative gain, N s/m or N·m s/rad.
    pub d: f32,
    /// Feed-forward, N or N·m.
    pub ff: f32,
}

impl Pid {
    /// All gains and the feed-forward zero.
    pub const ZERO: Self = Self { p: 0.0, i: 0.0, d: 0.0, ff: 0.0 };

    /// Returns a mutable reference to the gain of this kind.
    pub fn gain_mut(&mut self, gain: Gain) -> &mut f32 {
        match gain {
            Gain::P => &mut self.p,
            Gain::I => &mut self.i,
            Gain::D => &mut self.d,
            Gain::Ff => &mut self.ff,
        }
    }
}

/// Pose in the protocol, m and rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WirePose {
    /// True if the flotor is outside the sensors' range.
    pub out_of_range: bool,
    /// Position, m, then the angles defined in [`super::angles`], rad.
    pub at: AxisValues,
}

/// Control mode of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisMode {
    /// Free axis.
    #[default]
    Normal = 0,
    /// Axis locked at its position.
    Locked = 1,
    /// Axis constrained to a range.
    Constrained = 2,
    /// Axis of a flotor beyond the boundary sphere.
    Boundary = 3,
}

impl AxisMode {
    /// All modes, in protocol order.
    pub const ALL: [Self; 4] = [Self::Normal, Self::Locked, Self::Constrained, Self::Boundary];
}

/// State of the handle's buttons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons {
    /// True while the left button is pressed.
    pub left: bool,
    /// True while the right button is pressed.
    pub right: bool,
}

/// Position of a light spot on a position sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Coordinate along the sensor, m.
    pub x: f32,
    /// Coordinate across the sensor, m.
    pub y: f32,
    /// True if the spot is on the sensor.
    pub is_valid: bool,
}

/// Placement of a position sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellOffset {
    /// Offset along x, m.
    pub x: f32,
    /// Offset along y, m.
    pub y: f32,
    /// Rotation, rad.
    pub t: f32,
}

/// The controller's version: text of at most 15 characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Version {
    text: [u8; Version::LONGEST],
    length: usize,
}

impl Version {
    /// Longest text: clients copy the text unchecked into 16 bytes, with its final zero.
    const LONGEST: usize = 15;

    /// Creates a version from ASCII text; cuts text that is too long, and ends at the first unprintable byte.
    #[must_use]
    pub fn new(text: &[u8]) -> Self {
        let mut version = Self::default();
        for (place, byte) in version.text.iter_mut().zip(text) {
            if !(byte.is_ascii_graphic() || *byte == b' ') {
                break;
            }
            *place = *byte;
            version.length += 1;
        }
        version
    }

    /// Returns the version as text.
    #[must_use]
    pub fn text(&self) -> &str {
        std::str::from_utf8(self.text.get(..self.length).unwrap_or_default()).unwrap_or_default()
    }
}

/// Status of a reply: 0, or an error code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub i32);

impl Status {
    /// Success.
    pub const OK: Self = Self(0);
    /// Unknown function.
    pub const UNKNOWN: Self = Self(-1);
    /// Gain out of range.
    pub const GAIN_RANGE: Self = Self(1);
    /// No such gain or gain set.
    pub const GAIN_TYPE: Self = Self(3);
    /// No such axis.
    pub const AXIS: Self = Self(4);
    /// Position out of range.
    pub const POSITION: Self = Self(5);
    /// Force out of range.
    pub const FORCE: Self = Self(6);
    /// Current clipped to its limit.
    pub const CURRENT: Self = Self(7);
    /// Frequency out of range.
    pub const FREQUENCY: Self = Self(8);
    /// Speed out of range.
    pub const SPEED: Self = Self(10);
    /// Arguments missing.
    pub const COMMUNICATION: Self = Self(0x10);
    /// Another client commands; this client may only read.
    pub const RECEIVE_ONLY: Self = Self(0x30);
    /// No connection has this token.
    pub const NO_MATCH: Self = Self(0x62);
    /// The flotor has landed.
    pub const LANDED: Self = Self(0x100);
    /// The flotor has taken off.
    pub const TAKEN_OFF: Self = Self(0x200);
    /// The controller does not control the coils.
    pub const OFF_LINE: Self = Self(0x300);
    /// A coil is too hot.
    pub const OVERHEATED: Self = Self(0x400);
    /// The procedure timed out.
    pub const TIMER: Self = Self(0x800);
    /// Another procedure replaced this one.
    pub const REPLACED: Self = Self(0x801);

    /// Returns true for [`Status::OK`].
    #[must_use]
    pub const fn is_ok(self) -> bool {
        self.0 == 0
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = match *self {
            Self::OK => "done",
            Self::UNKNOWN => "unknown function",
            Self::GAIN_RANGE => "gain out of range",
            Self::GAIN_TYPE => "unknown gain",
            Self::AXIS => "unknown axis",
            Self::POSITION => "position out of range",
            Self::FORCE => "force out of range",
            Self::CURRENT => "current clipped",
            Self::FREQUENCY => "frequency out of range",
            Self::SPEED => "speed out of range",
            Self::COMMUNICATION => "communication error",
            Self::RECEIVE_ONLY => "another client controls the device",
            Self::NO_MATCH => "no connection with this token",
            Self::LANDED => "landed",
            Self::TAKEN_OFF => "taken off",
            Self::OFF_LINE => "off line",
            Self::OVERHEATED => "overheated",
            Self::TIMER => "timed out",
            Self::REPLACED => {
                "interrupted by another procedure, such as a landing by the emergency stop or by another program"
            }
            _ => "unknown status",
        };
        write!(f, "{words} ({:#x})", self.0)
    }
}

/// Fault bits; a fault switches the coils off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct FaultBits(pub u32);

impl FaultBits {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// The flotor is outside the sensors' range.
    pub const SENSOR_RANGE: Self = Self(1);
    /// A coil is too hot.
    pub const OVER_TEMPERATURE: Self = Self(2);
    /// A coil carried too much current for too long.
    pub const OVER_CURRENT: Self = Self(4);
    /// The flotor moves too fast.
    pub const OVER_SPEED: Self = Self(8);

    /// Returns the union of two sets of faults.
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns the faults that are not in `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Returns true if all faults of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns true if no fault is set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl fmt::Display for FaultBits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const WORDS: [(FaultBits, &str); 4] = [
            (FaultBits::SENSOR_RANGE, "sensor-range"),
            (FaultBits::OVER_TEMPERATURE, "over-temperature"),
            (FaultBits::OVER_CURRENT, "over-current"),
            (FaultBits::OVER_SPEED, "over-speed"),
        ];
        let mut words = WORDS.iter().filter(|(fault, _)| self.contains(*fault)).map(|(_, word)| word);
        f.write_str(words.next().map_or("none", |word| word))?;
        words.try_for_each(|word| write!(f, ",{word}"))
    }
}
