//! Answers of a subject, positions in a pair, and judgements of answers.

use crate::value::Value;
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

/// Answer to a step of a course.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// The first interval has more of the judged quality.
    First,
    /// The second interval has more of the judged quality.
    Second,
    /// No noticeable difference ("I don't know").
    Unsure,
    /// The signal was noticed.
    Present,
    /// The signal was not noticed.
    Absent,
    /// Point on the scale of the task.
    Rating(f64),
    /// Magnitude on the subject's free scale.
    Magnitude(f64),
    /// Answers to the items of a questionnaire, in order.
    Form(Vec<Value>),
    /// End of a rest.
    Rested,
}

/// Answer with the confidence in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Answer of the subject.
    pub answer: Answer,
    /// Confidence in the answer; `None` if the task has no such question.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
}

impl Reply {
    /// Creates a reply without confidence.
    #[must_use]
    pub fn plain(answer: Answer) -> Self {
        Self { answer, confidence: None }
    }
}
