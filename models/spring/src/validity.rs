//! Validity of a law's response at a pose.

/// Validity of one evaluation. The wrench is finite in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub enum Validity {
    /// The law holds as documented.
    Ok,
    /// The pose lies beyond the law's own range. The wrench is a smooth continuation: safe on the way back, but not
    /// accurate.
    Clamped,
    /// A law that follows an equilibrium from tick to tick is moving to a new one, over several ticks. The wrench is
    /// that of the present shape.
    NotConverged,
    /// The pose is outside the law's domain (plates in one point, lengths beyond reason). The wrench is zero.
    OutOfDomain,
    /// The pose has NaN or infinity, or its quaternion is not of unit length. The wrench is zero.
    InvalidInput,
}

impl Validity {
    /// Returns true if the wrench is that of a spring, also in motion or beyond the law's range.
    #[must_use]
    pub const fn has_answer(self) -> bool {
        match self {
            Self::Ok | Self::Clamped | Self::NotConverged => true,
            Self::OutOfDomain | Self::InvalidInput => false,
        }
    }
}
