//! Design as it is written in a study file, before its checks.

use crate::factor::Factor;
use crate::form::Questionnaire;
use crate::method::Method;
use crate::order::Order;
use crate::stimulus::Stimulus;
use crate::task::Task;
use serde::{Deserialize, Serialize};

/// Design as it is written in a study file, before its checks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Draft {
    /// Name of the task in file names: lower-case letters and digits.
    pub study: String,
    /// Factors.
    #[serde(default, rename = "factor", skip_serializing_if = "Vec::is_empty")]
    pub factors: Vec<Factor>,
    /// Stimulus; `None` if a trial presents its condition alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stimulus: Option<Stimulus>,
    /// Question of every trial.
    pub task: Task,
    /// Psychophysical method.
    pub method: Method,
    /// Blocks and sessions.
    #[serde(default)]
    pub blocks: Blocks,
    /// Questionnaires.
    #[serde(default, rename = "questionnaire", skip_serializing_if = "Vec::is_empty")]
    pub questionnaires: Vec<Questionnaire>,
}

/// Blocks and sessions of a design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Blocks {
    /// Factors that are constant within a block; the other factors within subjects are mixed.
    pub by: Vec<String>,
    /// Order of the blocks.
    pub order: Order,
    /// Number of times that a subject has all blocks in a session, each time in the next order.
    pub repetitions: u32,
    /// Number of sessions; each has all blocks.
    pub sessions: u32,
    /// Order of the tracks in a block.
    pub tracks: TrackOrder,
    /// Number of practice trials before the first block of a session.
    pub practice: u32,
    /// Number of trials between two rests; 0 for no rests.
    pub rest_every: u32,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            by: Vec::new(),
            order: Order::default(),
            repetitions: 1,
            sessions: 1,
            tracks: TrackOrder::default(),
            practice: 0,
            rest_every: 40,
        }
    }
}

/// Order of the tracks in a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrackOrder {
    /// Each trial belongs to a track drawn among those that are not over.
    #[default]
    Interleaved,
    /// One track after another, in random order.
    Successive,
}
