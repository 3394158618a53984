//! Checks and stress tests of models and devices.
//!
//! - [`stress`]: numerical stability of a force model.
//! - [`mod@validate`]: check of a plugin against the rules of the contract.
//! - [`subject`]: model under test; [`watch`]: detector of calls that do not return.
//! - [`sampling`]: low-discrepancy points; [`trajectory`]: smooth motions.
//! - [`plant`]: simplest device; [`call_timer`]: timing of single calls.
//!
//! Not real-time throughout.

pub mod call_timer;
pub mod plant;
mod platform;
pub mod sampling;
pub mod stress;
pub mod subject;
mod tally;
pub mod trajectory;
pub mod validate;
pub mod watch;
mod wording;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Default time between ticks, ns.
pub const PERIOD_NS: u64 = 1_000_000;

/// Extent of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// Takes seconds: for a daily check
    Short,
    /// Takes minutes, and finds rare failures too
    Full,
}

impl Size {
    /// Returns the name of the size on the command line and in reports.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Size::Short => "short",
            Size::Full => "full",
        }
    }
}

/// Receiver of the progress of a measurement, called from any thread. `()` ignores it.
pub trait Progress: Sync {
    /// Begins a measurement of `steps` steps.
    fn begin(&self, name: &str, steps: u64);
    /// Reports the completion of further steps.
    fn advance(&self, steps: u64);
}

impl Progress for () {
    fn begin(&self, _name: &str, _steps: u64) {}
    fn advance(&self, _steps: u64) {}
}
