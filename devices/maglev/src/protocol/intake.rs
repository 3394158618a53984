//! Replay protection: accepts each frame at most once, in order, of the right session; counts the rest.

use super::frame::Rejection;

/// Numbers of rejected frames, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejections {
    /// Frames rejected as [`Rejection::Length`].
    pub length: u32,
    /// Frames rejected as [`Rejection::Checksum`].
    pub checksum: u32,
    /// Frames rejected as [`Rejection::Magic`].
    pub magic: u32,
    /// Frames rejected as [`Rejection::Version`].
    pub version: u32,
    /// Frames rejected as [`Rejection::Kind`].
    pub kind: u32,
    /// Frames rejected as [`Rejection::NotFinite`].
    pub not_finite: u32,
    /// Frames rejected as [`Rejection::Duplicate`].
    pub duplicate: u32,
    /// Frames rejected as [`Rejection::Old`].
    pub old: u32,
    /// Frames rejected as [`Rejection::Session`].
    pub session: u32,
}

impl std::fmt::Display for Rejections {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { length, checksum, magic, version, kind, not_finite, duplicate, old, session } = self;
        write!(
            formatter,
            "length={length} checksum={checksum} magic={magic} version={version} kind={kind} not_finite={not_finite} \
             duplicate={duplicate} old={old} session={session}"
        )
    }
}

impl Rejections {
    /// Increments the counter of a reason.
    pub fn count(&mut self, rejection: Rejection) {
        let counter = match rejection {
            Rejection::Length => &mut self.length,
            Rejection::Checksum => &mut self.checksum,
            Rejection::Magic => &mut self.magic,
            Rejection::Version => &mut self.version,
            Rejection::Kind => &mut self.kind,
            Rejection::NotFinite => &mut self.not_finite,
            Rejection::Duplicate => &mut self.duplicate,
            Rejection::Old => &mut self.old,
            Rejection::Session => &mut self.session,
        };
        *counter = counter.saturating_add(1);
    }

    /// Returns the differences to an earlier count.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            length: self.length - earlier.length.min(self.length),
            checksum: self.checksum - earlier.checksum.min(self.checksum),
            magic: self.magic - earlier.magic.min(self.magic),
            version: self.version - earlier.version.min(self.version),
            kind: self.kind - earlier.kind.min(self.kind),
            not_finite: self.not_finite - earlier.not_finite.min(self.not_finite),
            duplicate: self.duplicate - earlier.duplicate.min(self.duplicate),
            old: self.old - earlier.old.min(self.old),
            session: self.session - earlier.session.min(self.session),
        }
    }

    /// Returns the sum over all reasons.
    #[must_use]
    pub fn total(&self) -> u32 {
        let Self { length, checksum, magic, version, kind, not_finite, duplicate, old, session } = *self;
        [length, checksum, magic, version, kind, not_finite, duplicate, old, session]
            .into_iter()
            .fold(0, u32::saturating_add)
    }
}

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
