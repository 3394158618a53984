//! The judges of models and devices, and what they ask with.
//!
//! - [`stress`]: numerical stability of a force model.
//! - [`mod@validate`]: a plugin against the rules of the contract.
//! - [`subject`]: the model under test; [`watch`]: finds the call that does not return.
//! - [`sampling`]: points that cover a space evenly; [`trajectory`]: smooth motions.
//! - [`plant`]: the plainest device; [`call_timer`]: times of single calls.
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

/// Time between ticks unless said otherwise, ns.
pub const PERIOD_NS: u64 = 1_000_000;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
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
