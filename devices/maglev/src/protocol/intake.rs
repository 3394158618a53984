//! Which frames may be acted on: each at most once, in order, of the right session. The rest is counted.

use super::frame::Rejection;

/// How many frames were not acted on, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejections {
    /// [`Rejection::Length`]
    pub length: u32,
    /// [`Rejection::Checksum`]
    pub checksum: u32,
    /// [`Rejection::Magic`]
    pub magic: u32,
    /// [`Rejection::Version`]
    pub version: u32,
    /// [`Rejection::Kind`]
    pub kind: u32,
    /// [`Rejection::NotFinite`]
    pub not_finite: u32,
    /// [`Rejection::Duplicate`]
    pub duplicate: u32,
    /// [`Rejection::Old`]
    pub old: u32,
    /// [`Rejection::Session`]
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
    /// Counts one.
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

    /// What came since an earlier count.
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

    /// All of them.
    #[must_use]
    pub fn total(&self) -> u32 {
        let Self { length, checksum, magic, version, kind, not_finite, duplicate, old, session } = *self;
        [length, checksum, magic, version, kind, not_finite, duplicate, old, session]
            .into_iter()
            .fold(0, u32::saturating_add)
    }
}

/// Accepts sequence numbers that only go up, wrapping, and counts everything else.
#[derive(Clone, Copy, Debug, Default)]
pub struct Intake {
    last: Option<u32>,
    rejections: Rejections,
}

impl Intake {
    /// Forgets the last sequence number: a new session begins. The counts stay.
    pub fn restart(&mut self) {
        self.last = None;
    }

    /// True if a frame of this sequence number is newer than all before; counts it otherwise.
    pub fn accept(&mut self, sequence: u32) -> bool {
        let rejection = match self.last {
            Some(last) if sequence == last => Rejection::Duplicate,
            // Serial number arithmetic (RFC 1982): the half of the circle before the last is over.
            Some(last) if sequence.wrapping_sub(last) >= 1 << 31 => Rejection::Old,
            _ => {
                self.last = Some(sequence);
                return true;
            }
        };
        self.reject(rejection);
        false
    }

    /// Counts a frame that is not acted on.
    pub fn reject(&mut self, rejection: Rejection) {
        self.rejections.count(rejection);
    }

    /// The newest sequence number, if there was one.
    #[must_use]
    pub fn last(&self) -> Option<u32> {
        self.last
    }

    /// What was not acted on so far.
    #[must_use]
    pub fn rejections(&self) -> &Rejections {
        &self.rejections
    }
}
