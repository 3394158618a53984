//! Measurements of plugins, loops and recordings.
//!
//! - [`evaluate`]: a force model at given [`poses`].
//! - [`stress`]: numerical stability of a force model.
//! - [`mod@validate`]: a plugin against the rules of the contract.
//! - [`mod@bench`]: cost and error of an evaluation.
//! - [`stability`]: the largest stable stiffness of the servo.
//! - [`jitter`]: timing of the servo.
//! - [`replay`]: the models of a recording re-evaluated.
//! - [`sampling`]: points that cover a space evenly.
//!
//! Nothing here runs a hand; not real-time throughout.

pub mod bench;
mod call_timer;
pub mod cli;
pub mod evaluate;
pub mod jitter;
mod plant;
pub mod poses;
pub mod replay;
pub mod sampling;
pub mod stability;
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
    /// Takes seconds: for a daily check
    Short,
    /// Takes minutes, and finds rare failures too
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

/// Receives the progress of a measurement, from any thread. `()` ignores it.
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
