//! Replay protection: accepts each frame at most once and in order, and counts rejected frames by reason. The receiver
//! checks the session.

use super::rejection::{Rejection, Rejections};

/// Replay protection: accepts strictly increasing sequence numbers, wrapping, and counts all others.
#[derive(Clone, Copy, Debug, Default)]
pub struct Intake {
    last: Option<u32>,
    rejections: Rejections,
}

impl Intake {
    /// Clears the last sequence number for a new session, but not the counts.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// Returns true for a sequence number newer than the last accepted number; counts a rejection otherwise.
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

    /// Returns the last accepted sequence number; `None` before the first.
    #[must_use]
    pub fn last(&self) -> Option<u32> {
        self.last
    }

    /// Returns the numbers of rejected frames, by reason.
    #[must_use]
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }
}
