//! Number of a subject.

use serde::{Deserialize, Serialize};

/// Subject number, 1 to 999; the only required data on a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u16", into = "u16")]
pub struct SubjectNumber(u16);

impl SubjectNumber {
    /// Largest number, so that a number has at most three digits in file names.
    pub const MOST: u16 = 999;

    /// Creates a subject number; `None` outside 1 to 999.
    #[must_use]
    pub fn new(number: u16) -> Option<Self> {
        (1..=Self::MOST).contains(&number).then_some(Self(number))
    }

    /// Returns the number.
    #[must_use]
    pub fn get(self) -> u16 {
        self.0
    }
}

impl TryFrom<u16> for SubjectNumber {
    type Error = String;

    fn try_from(number: u16) -> Result<Self, String> {
        Self::new(number).ok_or_else(|| format!("subject number {number}: must be 1 to {}", Self::MOST))
    }
}

impl From<SubjectNumber> for u16 {
    fn from(number: SubjectNumber) -> Self {
        number.0
    }
}

impl std::fmt::Display for SubjectNumber {
    /// Formats the number as in file names: `sub-07`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sub-{:02}", self.0)
    }
}
