//! Encoding and decoding of the types that a frame can contain.

use super::frame::{Field, Fields, Frame};
use super::values::{AxisMode, Buttons, Cell, CellOffset, FaultBits, Pid, Version, WirePose, of_code};

/// Implements [`Field`] for numbers of four bytes, little endian.
macro_rules! numbers {
    ($($number:ty),+) => {
        $(impl Field for $number {
            fn write(self, frame: &mut Frame) {
                frame.put(&self.to_le_bytes());
            }

            fn read(fields: &mut Fields<'_>) -> Option<Self> {
                fields.array().map(Self::from_le_bytes)
            }
        })+
    };
}

numbers!(i32, u32, f32);

/// Implements [`Field`] for structs, as the sequence of their members.
macro_rules! sequences {
    ($($name:ident { $($member:tt),+ })+) => {
        $(impl Field for $name {
            fn write(self, frame: &mut Frame) {
                frame$(.add(self.$member))+;
            }

            fn read(fields: &mut Fields<'_>) -> Option<Self> {
                Some(Self { $($member: fields.next()?),+ })
            }
        })+
    };
}

sequences! {
    Pid { p, i, d, ff }
    WirePose { out_of_range, at }
    Buttons { left, right }
    CellOffset { x, y, t }
    FaultBits { 0 }
}

impl<T: Field + Default, const N: usize> Field for [T; N] {
    fn write(self, frame: &mut Frame) {
        for field in self {
            frame.add(field);
        }
    }

    fn read(fields: &mut Fields<'_>) -> Option<Self> {
        let mut all = [T::default(); N];
        for field in &mut all {
            *field = fields.next()?;
        }
        Some(all)
    }
}

impl Field for bool {
    fn write(self, frame: &mut Frame) {
        frame.add(i32::from(self));
    }

    fn read(fields: &mut Fields<'_>) -> Option<Self> {
        fields.next::<i32>().map(|number| number != 0)
    }
}

impl Field for AxisMode {
    fn write(self, frame: &mut Frame) {
        frame.add(self as i32);
    }

    fn read(fields: &mut Fields<'_>) -> Option<Self> {
        of_code(&Self::ALL, fields.next()?)
    }
}

impl Field for Cell {
    /// Appends the coordinates and a digit: the only field of one byte.
    fn write(self, frame: &mut Frame) {
        frame.add(self.x).add(self.y).put(if self.is_valid { b"1" } else { b"0" });
    }

    fn read(fields: &mut Fields<'_>) -> Option<Self> {
        let (x, y, [digit]) = (fields.next()?, fields.next()?, fields.array()?);
        Some(Self { x, y, is_valid: digit != b'0' })
    }
}

impl Field for Version {
    /// Appends the text and a zero.
    fn write(self, frame: &mut Frame) {
        frame.put(self.text().as_bytes()).put(&[0]);
    }

    fn read(fields: &mut Fields<'_>) -> Option<Self> {
        let end = fields.rest().iter().position(|byte| *byte == 0)?;
        Some(Self::new(fields.rest().get(..end)?))
    }
}
