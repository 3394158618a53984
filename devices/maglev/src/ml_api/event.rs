//! Events: unsolicited messages of a controller on the callback connection, and their acknowledgements by a client.

use super::frame::{Fields, Frame};
use super::values::{AxisValues, Buttons, FaultBits, WirePose};

/// Number of the event that ends a callback connection, and of the function that requests the end.
const END: i32 = 71;

/// Kind of an event for which a client can register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Change of a button.
    Button = 74,
    /// Crossing of a boundary.
    Boundary = 75,
    /// Overheated coil.
    Overtemp = 76,
    /// Change of the fault bits.
    Fault = 77,
    /// Start of a servo interval.
    Tick = 78,
}

impl EventKind {
    /// All kinds, by number.
    pub const ALL: [Self; 5] = [Self::Button, Self::Boundary, Self::Overtemp, Self::Fault, Self::Tick];
}

/// Event with its payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Change of a button.
    Button(Buttons),
    /// Crossing of a boundary: for each axis -1 below its range, 1 above, 0 inside; last element: 1 outside the sphere.
    Boundary([i32; 7]),
    /// Overheated coil: temperatures of all coils, °C.
    Overtemp(AxisValues),
    /// Change of the fault bits.
    Fault(FaultBits),
    /// Start of a servo interval, with the pose at that time.
    Tick(WirePose),
    /// Last event: the connection ends.
    End,
}

impl Event {
    /// Returns the kind of the event; `None` for [`Event::End`].
    #[must_use]
    pub const fn kind(&self) -> Option<EventKind> {
        Some(match self {
            Self::Button(_) => EventKind::Button,
            Self::Boundary(_) => EventKind::Boundary,
            Self::Overtemp(_) => EventKind::Overtemp,
            Self::Fault(_) => EventKind::Fault,
            Self::Tick(_) => EventKind::Tick,
            Self::End => return None,
        })
    }

    /// Encodes the event as a frame.
    pub fn encode(&self) -> Frame {
        let mut frame = Frame::new(self.kind().map_or(END, |kind| kind as i32));
        match *self {
            Self::Button(buttons) => frame.add(buttons),
            Self::Boundary(sides) => frame.add(sides),
            Self::Overtemp(temperatures) => frame.add(temperatures),
            Self::Fault(bits) => frame.add(bits),
            Self::Tick(pose) => frame.add(pose),
            Self::End => &mut frame,
        };
        frame
    }

    /// Decodes a frame; `None` for any bytes that are not an event. Never panics.
    #[must_use]
    pub fn decode(frame: &[u8]) -> Option<Self> {
        let (id, mut fields) = Fields::of(frame)?;
        if id == END {
            return Some(Self::End);
        }
        Some(match EventKind::ALL.into_iter().find(|kind| *kind as i32 == id)? {
            EventKind::Button => Self::Button(fields.next()?),
            EventKind::Boundary => Self::Boundary(fields.next()?),
            EventKind::Overtemp => Self::Overtemp(fields.next()?),
            EventKind::Fault => Self::Fault(fields.next()?),
            EventKind::Tick => Self::Tick(fields.next()?),
        })
    }
}

/// Return value of a client's event handler. Acknowledgements carry no event number: they match events by order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acknowledgement(pub i32);

impl Acknowledgement {
    /// Acknowledgement of an event without a handler, and of [`Event::End`].
    pub const UNHANDLED: Self = Self(-1);

    /// Encodes the acknowledgement as a frame.
    pub fn encode(self) -> Frame {
        Frame::new(self.0)
    }

    /// Decodes a frame; `None` if malformed.
    #[must_use]
    pub fn decode(frame: &[u8]) -> Option<Self> {
        Fields::of(frame).map(|(value, _)| Self(value))
    }
}
