//! How a bridge is doing: what is lost or refused is shown.

use crate::couple::Carried;
use crate::request::{Refusal, Right, Ticket};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a bridge says of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// What it does.
    pub state: State,
    /// Process of the run; 0 without one.
    pub run: u32,
    /// Title of its scene.
    pub title: String,
    /// Ticks put on the network since the bridge started.
    pub published: u64,
    /// Ticks of this run that the host dropped because the bridge did not take them in time.
    pub dropped: u64,
    /// Requests not followed, by reason.
    pub refused: BTreeMap<Refusal, u64>,
    /// The most that may be asked for here.
    #[serde(default)]
    pub allow: Right,
    /// The bridge's word now: requests are made on it.
    #[serde(default)]
    pub ticket: Ticket,
    /// What was carried for each coupling with another host.
    #[serde(default)]
    pub couplings: BTreeMap<String, Carried>,
}

/// What a bridge does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// No host runs on its machine.
    #[default]
    Waiting,
    /// A host runs.
    Running,
    /// The emergency stop of its machine is pressed, and its owner has not released it.
    EmergencyStopped,
}

impl State {
    /// For people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            State::Waiting => "waiting",
            State::Running => "running",
            State::EmergencyStopped => "emergency stop",
        }
    }
}
