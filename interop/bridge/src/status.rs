//! Status of a bridge, as published on `flotor/NAME/status`.

use crate::couple::MessageCounts;
use crate::request::{Refusal, Right, Ticket};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Status of a bridge: state, current run, losses, refusals and couplings.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// State of the bridge.
    pub state: State,
    /// Process id of the run; 0 without a run.
    pub run: u32,
    /// Title of the run's scene; empty without a run.
    pub title: String,
    /// Number of ticks published since the bridge started.
    pub published: u64,
    /// Number of ticks of this run that the host dropped because the bridge was late.
    pub dropped: u64,
    /// Number of rejected requests since the bridge started, by reason.
    pub refused: BTreeMap<Refusal, u64>,
    /// Highest right whose requests are accepted.
    #[serde(default)]
    pub allow: Right,
    /// Current ticket, which requests repeat.
    #[serde(default)]
    pub ticket: Ticket,
    /// Message counts by coupling with another host.
    #[serde(default)]
    pub couplings: BTreeMap<String, MessageCounts>,
}

/// State of a bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// No run on the bridge's machine.
    #[default]
    Waiting,
    /// A run is in progress.
    Running,
    /// The emergency stop of the bridge's machine is pressed, and not released yet.
    EmergencyStopped,
}

impl State {
    /// Returns the display name of the state.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            State::Waiting => "waiting",
            State::Running => "running",
            State::EmergencyStopped => "emergency stop",
        }
    }
}
