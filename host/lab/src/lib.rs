//! Measurements of plugins, loops and recordings.
//!
//! - [`evaluate`]: a force model at given poses.
//! - [`stress`]: how far a force model can be trusted with a hand.
//! - [`mod@validate`]: a plugin against the rules of the contract.
//! - [`mod@bench`]: what an evaluation costs, and how wrong it is.
//! - [`stability`]: how stiff a spring the servo can render.
//! - [`jitter`]: how well the servo keeps time.
//! - [`replay`]: the models of a recording once more.
//! - [`sampling`]: points that cover a space evenly.
//!
//! Nothing here runs a hand; not real-time throughout.

pub mod bench;
pub mod cli;
pub mod evaluate;
pub mod jitter;
mod plant;
pub mod replay;
pub mod sampling;
pub mod stability;
mod stopwatch;
pub mod stress;
mod subject;
mod tally;
mod trajectory;
pub mod validate;

use clap::ValueEnum;
use serde::Serialize;

/// Time between ticks unless said otherwise, ns.
const PERIOD_NS: u64 = 1_000_000;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// Seconds: for a daily check
    Short,
    /// Minutes: what is rare shows as well
    Full,
}

impl Size {
    /// Its name.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Size::Short => "short",
            Size::Full => "full",
        }
    }
}

/// Told how a measurement comes along, from any thread. `()` does not listen.
pub trait Progress: Sync {
    /// So many steps of something begin.
    fn begin(&self, name: &str, steps: u64);
    /// So many more steps are done.
    fn advance(&self, steps: u64);
}

impl Progress for () {
    fn begin(&self, _name: &str, _steps: u64) {}
    fn advance(&self, _steps: u64) {}
}
