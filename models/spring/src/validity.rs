//! How far the answer of a law can be trusted at a pose.

/// Verdict on one evaluation. The wrench beside it is finite in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub enum Validity {
    /// The law holds as documented.
    Ok,
    /// The pose lies beyond the law's own range. The wrench is a smooth continuation, good for staying safe on
    /// the way back, not for numbers.
    Clamped,
    /// A law that follows an equilibrium from tick to tick is on its way to a new one, over several ticks. The
    /// wrench is that of the way.
    NotConverged,
    /// The law says nothing about this pose (plates in one point, lengths beyond reason). The wrench is zero.
    OutOfDomain,
    /// The pose holds NaN, infinity or no unit quaternion. The wrench is zero.
    InvalidInput,
}

impl Validity {
    /// Whether the wrench is that of a spring, be it on its way or beyond the law's range.
    #[must_use]
    pub const fn has_answer(self) -> bool {
        match self {
            Self::Ok | Self::Clamped | Self::NotConverged => true,
            Self::OutOfDomain | Self::InvalidInput => false,
        }
    }
}
