//! Positions in a pair, and judgements of answers.

use crate::words;
use serde::{Deserialize, Serialize};

/// Position within a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Position {
    /// Presented first.
    First,
    /// Presented second.
    Second,
}

impl Position {
    /// Returns the other position.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

words! { Position { First = "first", Second = "second" } }

/// Judgement of the answer to a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// The larger stimulus was named.
    Correct,
    /// The smaller stimulus was named.
    Wrong,
    /// Neither stimulus was named.
    Unsure,
}

impl Judgement {
    /// All judgements.
    pub const ALL: [Self; 3] = [Self::Correct, Self::Wrong, Self::Unsure];
}

words! { Judgement { Correct = "correct", Wrong = "wrong", Unsure = "unsure" } }
