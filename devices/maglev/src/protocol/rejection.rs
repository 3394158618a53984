//! Reasons for the rejection of frames, and their counts.

use std::fmt;

/// Reason for the rejection of bytes or of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// Too short, too long, or not decodable as a packet.
    Length,
    /// The checksum is wrong: the frame was damaged in transit.
    Checksum,
    /// Wrong first bytes for a frame in this direction.
    Magic,
    /// Another version of the protocol.
    Version,
    /// An unknown kind, mode, condition or page.
    Kind,
    /// A number is NaN or infinite.
    NotFinite,
    /// Sequence number repeated from the last accepted frame.
    Duplicate,
    /// Sequence number older than the last accepted number.
    Old,
    /// Frame of another session, for example of a host that has been replaced.
    Session,
}

/// Words of the reasons, in their sequence.
const WORDS: [&str; 9] =
    ["length", "checksum", "magic", "version", "kind", "not_finite", "duplicate", "old", "session"];

/// Numbers of rejected frames, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejections([u32; WORDS.len()]);

impl fmt::Display for Rejections {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (word, count)) in WORDS.iter().zip(self.0).enumerate() {
            write!(f, "{}{word}={count}", if index == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

impl Rejections {
    /// Increments the counter of a reason.
    pub fn count(&mut self, rejection: Rejection) {
        let counter = &mut self.0[rejection as usize];
        *counter = counter.saturating_add(1);
    }

    /// Returns the number of frames rejected for a reason.
    #[must_use]
    pub const fn of(&self, rejection: Rejection) -> u32 {
        self.0[rejection as usize]
    }

    /// Returns the numbers of frames rejected since `earlier`, by reason.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self(std::array::from_fn(|index| self.0[index].saturating_sub(earlier.0[index])))
    }

    /// Returns the sum over all reasons.
    #[must_use]
    pub fn total(&self) -> u32 {
        self.0.into_iter().fold(0, u32::saturating_add)
    }
}
