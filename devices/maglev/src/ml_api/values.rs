//! What the fields mean.

use std::fmt;

/// A number for each axis: x, y, z, then the rotations about them.
pub type Six = [f32; 6];

/// One of six axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Along x.
    X = 0,
    /// Along y.
    Y = 1,
    /// Along z.
    Z = 2,
    /// About x.
    Rx = 3,
    /// About y.
    Ry = 4,
    /// About z.
    Rz = 5,
}

impl Axis {
    /// All of them, in the order of the wire.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Rx, Self::Ry, Self::Rz];

    /// The axis of a code; the seventh, the grasp of other devices, is none.
    pub(super) fn of(code: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| *axis as i32 == code)
    }
}

/// Which gains act on an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GainSet {
    /// An axis that is free.
    Normal = 0,
    /// One that is locked where it was.
    Locked = 1,
    /// One beyond its constraint.
    Constrained = 2,
    /// Any, beyond the boundary sphere.
    Boundary = 3,
}

impl GainSet {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Normal, Self::Locked, Self::Constrained, Self::Boundary];

    pub(super) fn of(code: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|set| *set as i32 == code)
    }
}

/// One of the four gains of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// Proportional.
    P = 0,
    /// Integral.
    I = 1,
    /// Derivative.
    D = 2,
    /// Feed-forward.
    Ff = 3,
}

impl Gain {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::P, Self::I, Self::D, Self::Ff];

    pub(super) fn of(code: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|gain| *gain as i32 == code)
    }
}

/// Gains of an axis: N/m, N/(m s), N s/m, N; about it N·m/rad, N·m/(rad s), N·m s/rad, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pid {
    /// Proportional.
    pub p: f32,
    /// Integral.
    pub i: f32,
    /// Derivative.
    pub d: f32,
    /// Feed-forward.
    pub ff: f32,
}

impl Pid {
    /// No force at all.
    pub const ZERO: Self = Self { p: 0.0, i: 0.0, d: 0.0, ff: 0.0 };

    /// One of them.
    pub fn gain_mut(&mut self, gain: Gain) -> &mut f32 {
        match gain {
            Gain::P => &mut self.p,
            Gain::I => &mut self.i,
            Gain::D => &mut self.d,
            Gain::Ff => &mut self.ff,
        }
    }
}

/// A pose on the wire: m and rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WirePose {
    /// The sensors do not see the flotor.
    pub out_of_range: bool,
    /// Position and the angles of [`super::angles`].
    pub at: Six,
}

/// How an axis is controlled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisMode {
    /// Free.
    #[default]
    Normal = 0,
    /// Held where it was.
    Locked = 1,
    /// Kept inside a range.
    Constrained = 2,
    /// At the boundary sphere.
    Boundary = 3,
}

impl AxisMode {
    pub(super) fn of(code: i32) -> Option<Self> {
        [Self::Normal, Self::Locked, Self::Constrained, Self::Boundary]
            .into_iter()
            .find(|mode| *mode as i32 == code)
    }
}

/// Buttons of the handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons {
    /// The left one is pressed.
    pub left: bool,
    /// The right one is pressed.
    pub right: bool,
}

/// A light spot on its cell, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// Along the cell.
    pub x: f32,
    /// Across it.
    pub y: f32,
    /// The spot is on the cell.
    pub is_valid: bool,
}

/// Where a cell sits: m, m, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellOffset {
    /// Along x.
    pub x: f32,
    /// Along y.
    pub y: f32,
    /// Turn.
    pub t: f32,
}

/// The controller's version: text of at most 15 characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Version {
    text: [u8; Version::LONGEST],
    length: usize,
}

impl Version {
    /// A client copies it unchecked: with its end it is 16 bytes.
    const LONGEST: usize = 15;

    /// A text; what is too long is cut, what is no printable ASCII ends it.
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

    /// As text.
    #[must_use]
    pub fn text(&self) -> &str {
        std::str::from_utf8(self.text.get(..self.length).unwrap_or_default()).unwrap_or_default()
    }
}

/// What a controller says to a request: 0, or why not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status(pub i32);

impl Status {
    /// Done.
    pub const OK: Self = Self(0);
    /// A function it does not know.
    pub const UNKNOWN: Self = Self(-1);
    /// A gain out of range.
    pub const GAIN_RANGE: Self = Self(1);
    /// No such gain or gain set.
    pub const GAIN_TYPE: Self = Self(3);
    /// No such axis.
    pub const AXIS: Self = Self(4);
    /// A position out of range.
    pub const POSITION: Self = Self(5);
    /// A force out of range.
    pub const FORCE: Self = Self(6);
    /// A current that was clipped.
    pub const CURRENT: Self = Self(7);
    /// A frequency out of range.
    pub const FREQUENCY: Self = Self(8);
    /// A speed out of range.
    pub const SPEED: Self = Self(10);
    /// A request without its arguments.
    pub const COMMUNICATION: Self = Self(0x10);
    /// Another client commands.
    pub const RECEIVE_ONLY: Self = Self(0x30);
    /// No connection has that token.
    pub const NO_MATCH: Self = Self(0x62);
    /// It has landed.
    pub const LANDED: Self = Self(0x100);
    /// It has taken off.
    pub const TAKEN_OFF: Self = Self(0x200);
    /// It does not control the coils.
    pub const OFF_LINE: Self = Self(0x300);
    /// A coil is too hot.
    pub const OVERHEATED: Self = Self(0x400);
    /// It took too long.
    pub const TIMER: Self = Self(0x800);
    /// Another procedure took its place.
    pub const REPLACED: Self = Self(0x801);

    /// True for [`Status::OK`].
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
            Self::GAIN_TYPE => "no such gain",
            Self::AXIS => "no such axis",
            Self::POSITION => "position out of range",
            Self::FORCE => "force out of range",
            Self::CURRENT => "current clipped",
            Self::FREQUENCY => "frequency out of range",
            Self::SPEED => "speed out of range",
            Self::COMMUNICATION => "communication error",
            Self::RECEIVE_ONLY => "another client commands",
            Self::NO_MATCH => "no match",
            Self::LANDED => "landed",
            Self::TAKEN_OFF => "taken off",
            Self::OFF_LINE => "off line",
            Self::OVERHEATED => "overheated",
            Self::TIMER => "timed out",
            Self::REPLACED => "replaced",
            _ => "status",
        };
        write!(f, "{words} ({:#x})", self.0)
    }
}

/// What is wrong, a bit each; a fault switches the coils off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultBits(pub u32);

impl FaultBits {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// The sensors do not see the flotor.
    pub const SENSOR_RANGE: Self = Self(1);
    /// A coil is too hot.
    pub const OVER_TEMPERATURE: Self = Self(2);
    /// A coil carried too much current for too long.
    pub const OVER_CURRENT: Self = Self(4);
    /// The flotor moves too fast.
    pub const OVER_SPEED: Self = Self(8);

    /// Both.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What of it is not in the other.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// True if all of `other` is among them.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// True if nothing is wrong.
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
