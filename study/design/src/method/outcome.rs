//! Outcome of a trial for its track.

use crate::answer::Judgement;

/// Outcome of a trial for its track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The signal was reported, or the comparison was named as larger.
    Positive,
    /// The signal was not reported, or the standard was named as larger.
    Negative,
    /// Neither: "I don't know".
    Unsure,
    /// Rating.
    Rated(f64),
}

impl Outcome {
    /// Returns the outcome for a comparison below its standard, where naming the standard is right.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Positive => Self::Negative,
            Self::Negative => Self::Positive,
            other => other,
        }
    }

    pub(super) fn judgement(self) -> Judgement {
        match self {
            Self::Positive => Judgement::Correct,
            Self::Negative => Judgement::Wrong,
            Self::Unsure | Self::Rated(_) => Judgement::Unsure,
        }
    }
}
