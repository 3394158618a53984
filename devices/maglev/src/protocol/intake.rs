//! Replay protection: accepts each frame at most once, in order, of the right session; counts the rest.

use super::rejection::{Rejection, Rejections};

/// Replay protection: accepts strictly increasing sequence numbers, wrapping, and counts all others.
#[derive(Clone, Copy, Debug, Default)]
pub struct Intake {
    last: Option<u32>,
    rejections: Rejections,
}

impl Intake {
    /// Clears the last sequence number for a new session. The counts stay.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Returns true for a sequence number newer than all before; counts a rejection otherwise.
    pub fn accept(&mut self, sequence: u32) -> bool {
        let rejection = match self.last {
            Some(last) if sequence == last => Rejection::Duplicate,
            // Serial number arithmetic (RFC 1982): the half of the circle before the last number is old.
            Some(last) if sequence.wrapping_sub(last) >= 1 << 31 => Rejection::Old,
            _ => {
                self.last = Some(sequence);
                return true;
            }
        };
        self.reject(rejection);
        false
    }

    /// Counts a rejected frame.
    pub fn reject(&mut self, rejection: Rejection) {
        self.rejections.count(rejection);
    }

    /// Returns the newest sequence number; `None` before the first.
    #[must_use]
    pub fn last(&self) -> Option<u32> {
        self.last
    }

    /// Returns the numbers of rejected frames.
    #[must_use]
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }
}
