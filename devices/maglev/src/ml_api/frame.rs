//! One frame: its length, its code (function, status or event), and fields of four bytes.

/// Shortest frame: length and code.
pub const SHORTEST_BYTES: usize = 8;
/// Longest frame a controller accepts, and longest event a client does.
pub const LONGEST_BYTES: usize = 512;
/// Longest frame this code sends: a request for all gains of a set.
const LONGEST_SENT_BYTES: usize = 108;

/// A frame to send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    bytes: [u8; LONGEST_SENT_BYTES],
    length: usize,
}

impl Frame {
    /// A frame of this code, without fields.
    #[must_use]
    pub fn new(code: i32) -> Self {
        let mut frame = Self { bytes: [0; LONGEST_SENT_BYTES], length: 4 };
        frame.int(code);
        frame
    }

    /// The bytes to send.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Adds raw bytes; what does not fit is left out (no message of this protocol is so long).
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

    pub(super) fn int(&mut self, value: i32) -> &mut Self {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn float(&mut self, value: f32) -> &mut Self {
        self.put(&value.to_le_bytes())
    }

    pub(super) fn floats(&mut self, values: &[f32]) -> &mut Self {
        for value in values {
            self.float(*value);
        }
        self
    }
}

/// Fields of a frame that came in, one after another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
}

impl<'a> Fields<'a> {
    /// Code and fields of a whole frame; nothing if its length is not what it says or it has no code.
    pub(super) fn of(frame: &'a [u8]) -> Option<(i32, Self)> {
        let (length, rest) = frame.split_first_chunk()?;
        let (code, bytes) = rest.split_first_chunk()?;
        let told = usize::try_from(i32::from_le_bytes(*length)).ok()?;
        (told == frame.len()).then_some((i32::from_le_bytes(*code), Self { bytes }))
    }

    /// The next four bytes.
    pub(super) fn int(&mut self) -> Option<i32> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn float(&mut self) -> Option<f32> {
        self.array().map(f32::from_le_bytes)
    }

    pub(super) fn floats<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.float()?;
        }
        Some(values)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*first)
    }

    /// What is left.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes
    }
}
