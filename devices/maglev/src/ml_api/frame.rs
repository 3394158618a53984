//! One frame: its length, its code (function, status or event), and fields of four bytes.

/// Length of the shortest frame, bytes: length and code.
pub const SHORTEST_BYTES: usize = 8;
/// Length of the longest frame that a controller accepts, and of the longest event that a client accepts, bytes.
pub const LONGEST_BYTES: usize = 512;
/// Length of the longest frame sent by this code, bytes: a request with all gains of a set.
const LONGEST_SENT_BYTES: usize = 108;

/// Type of a field, or of several fields in a row.
pub(super) trait Field: Copy {
    /// Appends the field to a frame.
    fn write(self, frame: &mut Frame);

    /// Reads the field; `None` if bytes are missing or are not a value of the type.
    fn read(fields: &mut Fields<'_>) -> Option<Self>;
}

/// Encoded frame to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub struct Frame {
    bytes: [u8; LONGEST_SENT_BYTES],
    length: usize,
}

impl Frame {
    /// Creates a frame with this code (function, status or event) and no fields.
    pub fn new(code: i32) -> Self {
        let mut frame = Self { bytes: [0; LONGEST_SENT_BYTES], length: 4 };
        frame.add(code);
        frame
    }

    /// Returns the encoded frame.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Appends raw bytes; drops them if they do not fit (no message of this protocol is so long).
    pub(super) fn put(&mut self, bytes: &[u8]) -> &mut Self {
        if let Some(room) = self.bytes.get_mut(self.length..self.length + bytes.len()) {
            room.copy_from_slice(bytes);
            self.length += bytes.len();
        }
        let length = u32::try_from(self.length).unwrap_or(u32::MAX);
        if let Some(head) = self.bytes.first_chunk_mut() {
            *head = length.to_le_bytes();
        }
        self
    }

    /// Appends a field.
    pub(super) fn add(&mut self, field: impl Field) -> &mut Self {
        field.write(self);
        self
    }
}

/// Sequential reader for the fields of a received frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
}

impl<'a> Fields<'a> {
    /// Splits a whole frame into code and fields; `None` if its length field is wrong or the code is missing.
    pub(super) fn of(frame: &'a [u8]) -> Option<(i32, Self)> {
        let (length, rest) = frame.split_first_chunk()?;
        let (code, bytes) = rest.split_first_chunk()?;
        let declared = usize::try_from(i32::from_le_bytes(*length)).ok()?;
        (declared == frame.len()).then_some((i32::from_le_bytes(*code), Self { bytes }))
    }

    /// Reads the next field.
    pub(super) fn next<T: Field>(&mut self) -> Option<T> {
        T::read(self)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*first)
    }

    /// Returns the unread bytes.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes
    }
}
