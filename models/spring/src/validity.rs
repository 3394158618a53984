//! Validity of a law's response at a pose.

/// Validity of one evaluation of a law. The wrench is finite in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub enum Validity {
    /// The law holds as documented.
    Ok,
    /// The pose is beyond the law's accurate range. The wrench is a smooth continuation, but not accurate.
    Clamped,
    /// A law that follows an equilibrium from tick to tick moves to a new equilibrium over several ticks. The wrench is
    /// that of the present shape.
    NotConverged,
    /// The pose is outside the law's domain (plates in one point, far apart, or upside down). The wrench is zero; in the printed
    /// law of the thesis, only the components that would not be finite.
    OutOfDomain,
    /// The pose has NaN or infinity, or its quaternion is not of unit length. The wrench is zero.
    InvalidInput,
}

flotor_hal::restorable!(Validity = Ok | Clamped | NotConverged | OutOfDomain | InvalidInput);

impl Validity {
    /// Returns true if the wrench is the response of the spring: accurate, of a shape in motion, or beyond the accurate range.
    #[must_use]
    pub const fn has_answer(self) -> bool {
        match self {
            Self::Ok | Self::Clamped | Self::NotConverged => true,
            Self::OutOfDomain | Self::InvalidInput => false,
        }
    }
}
