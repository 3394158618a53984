//! Trials, answers and explorations.

use crate::kinematics::StimulusKinematics;
use crate::time_of_day::TimeOfDay;
use flotor_study_design::words;
use serde::{Deserialize, Serialize};

pub use flotor_study_design::answer::{Judgement, Position};

/// Sensory modalities of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modality {
    /// Vision and haptics.
    Vh,
    /// Haptics alone.
    H,
}

impl Modality {
    /// Both modalities in the order of the tables.
    pub const ALL: [Self; 2] = [Self::Vh, Self::H];

    /// Returns the other modality.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Vh => Self::H,
            Self::H => Self::Vh,
        }
    }
}

words! { Modality { Vh = "vh", H = "h" } }

/// Role of a trial in the analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Practice, never analysed.
    Practice,
    /// Counted trial.
    Main,
    /// Check: a pair of equal stimuli, to detect false alarms. Does not count in thresholds and effects.
    Catch,
    /// Check: a pair with an obvious difference, to detect a misread question or swapped keys. Does not count in thresholds and
    /// effects.
    Obvious,
    /// Check: a repeated presentation, to measure the agreement of answers. Does not count in thresholds and effects.
    RepeatCheck,
}

impl Phase {
    /// Returns the phase as shown to the subject: a check appears as a counted trial.
    #[must_use]
    pub fn shown(self) -> Self {
        if self == Self::Practice { Self::Practice } else { Self::Main }
    }
}

words! {
    Phase {
        Practice = "practice", Main = "main", Catch = "catch", Obvious = "obvious", RepeatCheck = "repeat_check",
    }
}

/// Two stimuli to compare: a base and a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// Base, in the stimulus's unit.
    pub base: f64,
    /// Comparison, in the stimulus's unit.
    pub comparison: f64,
    /// Magnitude of the difference of comparison and base, as a fraction of the base.
    pub delta: f64,
    /// Position of the comparison.
    pub comparison_at: Position,
    /// Position of the larger stimulus; for equal stimuli, the position it would have with a difference on the same side.
    pub larger_at: Position,
}

impl Pair {
    /// Returns the values in the order of presentation.
    #[must_use]
    pub fn in_order(&self) -> [f64; 2] {
        match self.comparison_at {
            Position::First => [self.comparison, self.base],
            Position::Second => [self.base, self.comparison],
        }
    }
}

/// Stimuli of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Presented {
    /// One stimulus to rate.
    One {
        /// Value in the stimulus's unit.
        value: f64,
    },
    /// Two stimuli to compare.
    Pair(Pair),
}

impl Presented {
    /// Returns the rated stimulus, or the base of a pair, in the stimulus's unit.
    #[must_use]
    pub fn level(&self) -> f64 {
        match self {
            Self::One { value } => *value,
            Self::Pair(pair) => pair.base,
        }
    }

    /// Returns the values in the order of presentation.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::One { value } => vec![*value],
            Self::Pair(pair) => pair.in_order().to_vec(),
        }
    }
}

/// Presentation of a stimulus or pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Number of the presentation in the sitting, from 1; 0 for practice before a resumed sitting, which is not part of the
    /// sitting.
    pub number: u32,
    /// Role of the trial in the analysis.
    pub phase: Phase,
    /// Replication number, from 1; 0 for practice.
    pub replication: u32,
    /// Number of the adaptive track, from 1 over the whole sitting; 0 without a track.
    pub track: u32,
    /// Sensory modalities.
    pub modality: Modality,
    /// Presented stimuli.
    pub presented: Presented,
    /// Number of earlier presentations of this trial in which the handle left its range.
    pub repeat: u32,
}

/// Answer of a subject.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// The first stimulus of a pair has more of the judged quality.
    First,
    /// The second stimulus of a pair has more of the judged quality.
    Second,
    /// No noticeable difference ("I don't know").
    DontKnow,
    /// Rating on the subject's free scale.
    Rating(f64),
    /// Practice without an answer.
    Seen,
}

impl Response {
    /// Returns the position of the named stimulus of a pair; `None` for other answers.
    #[must_use]
    pub fn named(self) -> Option<Position> {
        match self {
            Self::First => Some(Position::First),
            Self::Second => Some(Position::Second),
            Self::DontKnow | Self::Rating(_) | Self::Seen => None,
        }
    }

    /// Returns the rating; `None` for another answer.
    #[must_use]
    pub fn rating(self) -> Option<f64> {
        if let Self::Rating(rating) = self { Some(rating) } else { None }
    }

    /// Returns the label used in tables, without a rating's number.
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

/// Measurements during a presentation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exploration {
    /// True if the handle left its range; [`AtBoundary`](crate::protocol::AtBoundary) then decides whether the presentation is
    /// repeated.
    pub boundary_hit: bool,
    /// Response time: from the end of the presentation to the answer, s, the time to a withdrawn answer included; `None` for
    /// simulated observers.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub response_time_s: Option<f64>,
    /// Movement measures of each stimulus in the order of presentation, again for each repetition on request; empty without stored
    /// movement.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub kinematics: Vec<StimulusKinematics>,
    /// Number of ticks the servo missed during the presentation.
    pub missed_ticks: u64,
    /// Time of day from which the first stimulus could be felt; `None` for simulated observers.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub onset: Option<TimeOfDay>,
}
