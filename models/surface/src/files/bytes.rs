//! Reader of binary numbers with bounds checks.

use super::Problem;

/// Byte order of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

/// Type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// Cursor that reads successive numbers.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
    order: Order,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize, order: Order) -> Self {
        Self { bytes, at, order }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Problem> {
        let end = self.at.checked_add(N);
        let taken = end.and_then(|end| self.bytes.get(self.at..end)).and_then(|slice| slice.try_into().ok());
        let mut taken: [u8; N] = taken.ok_or_else(|| {
            Problem::byte(
                self.bytes.len(),
                "the file ends here, before all of its data; copy or export the file again",
            )
        })?;
        self.at += N;
        if self.order == Order::Big {
            taken.reverse();
        }
        Ok(taken)
    }

    pub(super) fn skip(&mut self, count: usize) -> Result<(), Problem> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        self.at = end.ok_or_else(|| {
            Problem::byte(
                self.bytes.len(),
                "the file ends here, before all of its data; copy or export the file again",
            )
        })?;
        Ok(())
    }

    pub(super) fn number(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        Ok(match scalar {
            Scalar::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// Reads a count or an index.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
    pub(super) fn index(&mut self, scalar: Scalar) -> Result<usize, Problem> {
        let at = self.at;
        let number = self.number(scalar)?;
        if number < 0.0 || number.fract() != 0.0 || number > 4.0e9 {
            return Err(Problem::byte(at, "a whole number is expected here; export the mesh again"));
        }
        Ok(number as usize)
    }
}
