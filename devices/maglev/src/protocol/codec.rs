//! Codec of frames: fields at fixed offsets, the envelope, and the checksum.

use super::rejection::Rejection;

/// Length of a frame, bytes: one packet of an interrupt endpoint of 64 bytes.
pub const FRAME_BYTES: usize = 64;
/// Version of the protocol.
pub const VERSION: u8 = 1;
/// Number of bytes covered by the checksum.
const CHECKED_BYTES: usize = 60;

/// Encoder of a frame, field by field.
pub(super) struct Writer {
    bytes: [u8; FRAME_BYTES],
}

impl Writer {
    pub(super) fn new(magic: u16, sequence: u32, acknowledged: u32, time_us: u32, session: u32) -> Self {
        let mut writer = Self { bytes: [0; FRAME_BYTES] };
        writer.word(0, magic).put(2, &[VERSION]);
        writer.double(4, sequence).double(8, acknowledged).double(12, time_us).double(56, session);
        writer
    }

    pub(super) fn put(&mut self, at: usize, field: &[u8]) -> &mut Self {
        if let Some(room) = self.bytes.get_mut(at..at + field.len()) {
            room.copy_from_slice(field);
        }
        self
    }

    pub(super) fn kind(&mut self, kind: u8) -> &mut Self {
        self.put(3, &[kind])
    }

    pub(super) fn word(&mut self, at: usize, value: u16) -> &mut Self {
        self.put(at, &value.to_le_bytes())
    }

    pub(super) fn double(&mut self, at: usize, value: u32) -> &mut Self {
        self.put(at, &value.to_le_bytes())
    }

    pub(super) fn floats(&mut self, at: usize, values: &[f32]) -> &mut Self {
        for (index, value) in values.iter().enumerate() {
            self.put(at + 4 * index, &value.to_le_bytes());
        }
        self
    }

    pub(super) fn steps(&mut self, at: usize, values: [i16; 3]) -> &mut Self {
        for (index, value) in values.iter().enumerate() {
            self.put(at + 2 * index, &value.to_le_bytes());
        }
        self
    }

    pub(super) fn finish(mut self) -> [u8; FRAME_BYTES] {
        let checksum = checksum(&self.bytes);
        self.double(CHECKED_BYTES, checksum);
        self.bytes
    }
}

/// Decoder of a frame with valid length, checksum, magic and version, field by field.
pub(super) struct Reader<'b> {
    bytes: &'b [u8; FRAME_BYTES],
}

impl<'b> Reader<'b> {
    pub(super) fn new(bytes: &'b [u8], magic: u16) -> Result<Self, Rejection> {
        let reader = Self { bytes: bytes.try_into().map_err(|_| Rejection::Length)? };
        // The checksum first: a damaged frame has no other valid field.
        if reader.double(CHECKED_BYTES) != checksum(reader.bytes) {
            return Err(Rejection::Checksum);
        }
        if reader.word(0) != magic {
            return Err(Rejection::Magic);
        }
        if reader.array::<1>(2) != [VERSION] {
            return Err(Rejection::Version);
        }
        Ok(reader)
    }

    pub(super) fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        self.bytes.get(at..at + N).and_then(|field| field.try_into().ok()).unwrap_or([0; N])
    }

    pub(super) fn kind(&self) -> u8 {
        self.array::<1>(3)[0]
    }

    pub(super) fn word(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.array(at))
    }

    pub(super) fn double(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.array(at))
    }

    pub(super) fn floats<const N: usize>(&self, at: usize) -> Result<[f32; N], Rejection> {
        let values = std::array::from_fn(|index| f32::from_le_bytes(self.array(at + 4 * index)));
        if values.iter().all(|value: &f32| value.is_finite()) {
            Ok(values)
        } else {
            Err(Rejection::NotFinite)
        }
    }

    pub(super) fn steps(&self, at: usize) -> [i16; 3] {
        std::array::from_fn(|index| i16::from_le_bytes(self.array(at + 2 * index)))
    }

    /// Returns sequence number, acknowledged number, time and session.
    pub(super) fn envelope(&self) -> [u32; 4] {
        [4, 8, 12, 56].map(|at| self.double(at))
    }
}

/// Returns the CRC-32 (as in Ethernet and zlib, ISO 3309) of the covered bytes.
fn checksum(bytes: &[u8; FRAME_BYTES]) -> u32 {
    crc32fast::hash(bytes.get(..CHECKED_BYTES).unwrap_or(bytes))
}
