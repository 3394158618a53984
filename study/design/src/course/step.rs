//! Steps of a course.

use crate::answer::Position;
use crate::design::Condition;
use crate::value::Value;
use serde::{Deserialize, Serialize};

/// Step of a course.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Step {
    /// A trial is presented and answered.
    Trial(Trial),
    /// A questionnaire is answered.
    Form {
        /// Index of the questionnaire in the design.
        questionnaire: usize,
        /// Number of the block before it; 0 before the first.
        block: u32,
    },
    /// The subject rests.
    Rest {
        /// Number of trials before the rest.
        after: u32,
    },
}

/// Trial of a designed study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Number in the session, from 1; practice and repeats included.
    pub number: u32,
    /// Role of the trial in the analysis.
    pub phase: Phase,
    /// Number of the block in the session, from 1.
    pub block: u32,
    /// Number of the track in the session, from 1; 0 without a track.
    pub track: u32,
    /// Levels of all factors.
    pub condition: Condition,
    /// Level of the stimulus on its scale; 0 without the signal, `None` without a stimulus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<f64>,
    /// Values of the stimulus's setting in the intervals, in order; empty without a stimulus.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intervals: Vec<Value>,
    /// Position of the comparison; `None` for one interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comparison_at: Option<Position>,
    /// Presence of the signal in a detection; `None` for another question.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signal: Option<Signal>,
    /// Number of earlier presentations of this trial in which the handle left its range.
    pub repeat: u32,
}

/// Role of a trial in the analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Practice, never analysed.
    Practice,
    /// Counted trial.
    Main,
}

/// Presence of the signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Signal {
    /// The trial has the signal.
    Present,
    /// The trial has no signal.
    Absent,
}
