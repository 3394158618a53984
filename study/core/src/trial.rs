//! What is presented and what is answered.

use crate::kinematics::StimulusKinematics;
use crate::time_of_day::TimeOfDay;
use serde::{Deserialize, Serialize};

/// What a subject sees and feels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modality {
    /// Vision and haptics.
    Vh,
    /// Haptics alone.
    H,
}

impl Modality {
    /// Both, in the order of the tables.
    pub const ALL: [Self; 2] = [Self::Vh, Self::H];

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Vh => Self::H,
            Self::H => Self::Vh,
        }
    }

    /// As in the tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Vh => "vh",
            Self::H => "h",
        }
    }
}

/// Whether a trial counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Shown beforehand, never analysed.
    Practice,
    /// Counts.
    Main,
    /// A check: a pair of equal stimuli, for a false alarm. Not analysed with those that count.
    Catch,
    /// A check: a pair with an obvious difference, for a question misread and keys the wrong way round. Not analysed with those that
    /// count.
    Obvious,
    /// A check: what was presented once before, for how alike the two answers are. Not analysed with those that count.
    RepeatCheck,
}

impl Phase {
    /// As in the tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Practice => "practice",
            Self::Main => "main",
            Self::Catch => "catch",
            Self::Obvious => "obvious",
            Self::RepeatCheck => "repeat_check",
        }
    }

    /// What the subject may know of it: a check looks like a trial that counts.
    #[must_use]
    pub fn shown(self) -> Self {
        if self == Self::Practice { Self::Practice } else { Self::Main }
    }
}

/// First or second of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Position {
    /// Presented first.
    First,
    /// Presented second.
    Second,
}

/// Two stimuli to compare: a base and one that differs from it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The base, in the stimulus's unit.
    pub base: f64,
    /// The other one.
    pub comparison: f64,
    /// Their difference as a share of the base, never negative.
    pub delta: f64,
    /// When the comparison is presented.
    pub comparison_at: Position,
    /// Where the larger one is presented. For equal stimuli, where it would have been.
    pub larger_at: Position,
}

impl Pair {
    /// The values in the order they are presented.
    #[must_use]
    pub fn in_order(&self) -> [f64; 2] {
        match self.comparison_at {
            Position::First => [self.comparison, self.base],
            Position::Second => [self.base, self.comparison],
        }
    }
}

/// What is presented in a trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Presented {
    /// One stimulus to be rated.
    One {
        /// In the stimulus's unit.
        value: f64,
    },
    /// Two to be compared.
    Pair(Pair),
}

impl Presented {
    /// The values in the order they are presented.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::One { value } => vec![*value],
            Self::Pair(pair) => pair.in_order().to_vec(),
        }
    }
}

/// One presentation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Count of presentations in the sitting, from 1; 0: practice before a sitting goes on, which is no part of it.
    pub number: u32,
    /// Whether it counts.
    pub phase: Phase,
    /// Replication, from 1; 0 for practice.
    pub replication: u32,
    /// Track of a staircase, from 1 over the whole sitting; 0 where there is none.
    pub track: u32,
    /// Modality.
    pub modality: Modality,
    /// Stimuli.
    pub presented: Presented,
    /// How often this presentation had to be repeated before, because the handle left its range.
    pub repeat: u32,
}

/// What a subject answers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// The first of a pair has more of it.
    First,
    /// The second has.
    Second,
    /// Cannot tell.
    DontKnow,
    /// A number of the subject's own scale.
    Rating(f64),
    /// Felt in practice; no answer asked.
    Seen,
}

impl Response {
    /// In words, without a rating's number.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Second => "second",
            Self::DontKnow => "dont_know",
            Self::Rating(_) => "rating",
            Self::Seen => "seen",
        }
    }
}

/// What an answer to a pair is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// The larger one was named.
    Correct,
    /// The smaller one was.
    Wrong,
    /// Neither.
    Unsure,
}

/// What happened while stimuli were presented.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exploration {
    /// The handle left its range: the presentation is to be repeated.
    pub boundary_hit: bool,
    /// From the end of the presentation to the answer, s; unknown for simulated observers.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub response_time_s: Option<f64>,
    /// One entry per stimulus in the order of presentation, where a device was there to measure; all of them once more for each time
    /// the trial was felt again.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub kinematics: Vec<StimulusKinematics>,
    /// Ticks the servo missed.
    pub missed_ticks: u64,
    /// When the first stimulus could be felt; unknown for simulated observers.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub onset: Option<TimeOfDay>,
}
