//! The question of a trial, and the form of its answer.

use crate::answer::Answer;
use serde::{Deserialize, Serialize};

/// Question of every trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TaskTable", into = "TaskTable")]
pub struct Task {
    /// Kind of the answer.
    pub ask: Ask,
    /// Text on the screen; empty for the text of the program.
    pub question: String,
    /// Scale of the confidence in each answer; `None` if it is not part of the question.
    pub confidence: Option<AnswerScale>,
}

/// Kind of an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Ask {
    /// Two intervals: the one with more.
    Choice {
        /// True if "I don't know" is an answer.
        unsure: bool,
    },
    /// One interval: signal or none.
    Detection {
        /// Share of trials without the signal, from 0 to below 1; not used by the method of limits.
        absent_share: f64,
    },
    /// One interval: a point on a scale.
    Rating {
        /// The scale.
        scale: AnswerScale,
    },
    /// One interval: any number above 0 (magnitude estimation with free modulus).
    Magnitude,
}

/// Scale of equidistant points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnswerScale {
    /// Smallest point.
    pub least: f64,
    /// Largest point.
    pub most: f64,
    /// Distance of two points.
    #[serde(default = "unit")]
    pub step: f64,
    /// Text at the smallest point.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub low: String,
    /// Text at the largest point.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub high: String,
}

fn unit() -> f64 {
    1.0
}

impl AnswerScale {
    /// Returns true for a point of the scale.
    #[must_use]
    pub fn has(&self, point: f64) -> bool {
        let steps = (point - self.least) / self.step;
        (self.least..=self.most).contains(&point) && (steps - steps.round()).abs() < 1.0e-9
    }

    /// Returns the point closest to a number.
    #[must_use]
    pub fn nearest(&self, number: f64) -> f64 {
        let steps = ((number - self.least) / self.step).round();
        (self.least + steps * self.step).clamp(self.least, self.most)
    }

    /// Describes the defect of a scale; `None` for a scale with two or more points.
    pub(crate) fn defect(&self) -> Option<String> {
        let Self { least, most, step, .. } = self;
        let steps = (most - least) / step;
        let is_right =
            *step > 0.0 && (1.0..=1000.0).contains(&steps) && (steps - steps.round()).abs() < 1.0e-9;
        (!is_right).then(|| {
            format!("a scale from {least} to {most} by {step}: write least < most, and a step that divides the range (at most 1000 times)")
        })
    }
}

impl Task {
    /// Returns the name of the kind in a study file.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self.ask {
            Ask::Choice { .. } => "choice",
            Ask::Detection { .. } => "detection",
            Ask::Rating { .. } => "rating",
            Ask::Magnitude => "magnitude",
        }
    }

    /// Returns the number of intervals of a trial.
    #[must_use]
    pub fn intervals(&self) -> usize {
        if matches!(self.ask, Ask::Choice { .. }) { 2 } else { 1 }
    }

    /// Returns true for an answer of this kind.
    #[must_use]
    pub fn accepts(&self, answer: &Answer) -> bool {
        match (&self.ask, answer) {
            (Ask::Choice { .. }, Answer::First | Answer::Second) => true,
            (Ask::Choice { unsure }, Answer::Unsure) => *unsure,
            (Ask::Detection { .. }, Answer::Present | Answer::Absent) => true,
            (Ask::Rating { scale }, Answer::Rating(point)) => scale.has(*point),
            (Ask::Magnitude, Answer::Magnitude(number)) => number.is_finite() && *number > 0.0,
            _ => false,
        }
    }
}

/// Table of a task in a study file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TaskTable {
    ask: Kind,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    question: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unsure: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    absent_share: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<AnswerScale>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    confidence: Option<AnswerScale>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Choice,
    Detection,
    Rating,
    Magnitude,
}

impl TryFrom<TaskTable> for Task {
    type Error = String;

    fn try_from(table: TaskTable) -> Result<Self, String> {
        let TaskTable { ask, question, unsure, absent_share, scale, confidence } = table;
        let ask = match (ask, unsure, absent_share, scale) {
            (Kind::Choice, unsure, None, None) => Ask::Choice { unsure: unsure.unwrap_or(false) },
            (Kind::Detection, None, share, None) => Ask::Detection { absent_share: share.unwrap_or(0.5) },
            (Kind::Rating, None, None, Some(scale)) => Ask::Rating { scale },
            (Kind::Rating, None, None, None) => {
                return Err("task: a rating needs `scale = { least = 1, most = 7 }`".to_owned());
            }
            (Kind::Magnitude, None, None, None) => Ask::Magnitude,
            _ => {
                return Err("task: `unsure` belongs to a choice, `absent_share` to a detection, `scale` to a rating; remove what belongs to another question"
                    .to_owned());
            }
        };
        Ok(Self { ask, question, confidence })
    }
}

impl From<Task> for TaskTable {
    fn from(Task { ask, question, confidence }: Task) -> Self {
        let none = |ask| Self { ask, question, unsure: None, absent_share: None, scale: None, confidence };
        match ask {
            Ask::Choice { unsure } => Self { unsure: Some(unsure), ..none(Kind::Choice) },
            Ask::Detection { absent_share } => {
                Self { absent_share: Some(absent_share), ..none(Kind::Detection) }
            }
            Ask::Rating { scale } => Self { scale: Some(scale), ..none(Kind::Rating) },
            Ask::Magnitude => none(Kind::Magnitude),
        }
    }
}
