//! Work against precision: what an evaluation of a force model costs, and how wrong it is, for many settings of it.
//!
//! Every case goes along one smooth path (1 to 3 Hz in all six coordinates, 1 kHz) and is timed three ways: without
//! interruption (the mean of a tick), call by call (median and p99.9), and cold (after a reset, each call at another
//! pose). Its error is the distance from a reference that walks the same path: another setting of the same model,
//! computed in this run, not a table.
//!
//! - `path`: the motion. `stopwatch`: the times. `error`: the distance from the reference.
//! - `reach_hand`: the whole loop: what of the reference's force reaches a hand, through sampling and delay.
//! - `report`: table, CSV and picture.
//!
//! Not real-time.

mod error;
mod path;
mod reach_hand;
mod report;
mod stopwatch;

pub use error::Distance;
pub use reach_hand::{Losses, Sampling};
pub use report::{BenchReport, CaseRow};
pub use stopwatch::Times;

use flotor_hal::abi::loader::{LoadError, Plugin, Setting};
use flotor_hal::{Demand, LoopConfig};

/// One setting of the model.
#[derive(Clone, Debug)]
pub struct Case {
    /// What the table calls it.
    pub name: String,
    /// Its settings.
    pub settings: Vec<Setting>,
}

/// How much is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Seconds: enough for a median.
    Short,
    /// Minutes: enough for p99.9.
    Full,
}

impl Effort {
    /// Length of the path, ticks.
    const fn ticks(self) -> usize {
        match self {
            Self::Short => 2_000,
            Self::Full => 20_000,
        }
    }

    /// How often the path is walked; the fastest counts.
    const fn rounds(self) -> usize {
        match self {
            Self::Short => 3,
            Self::Full => 9,
        }
    }
}

/// Hears how far the work is.
pub trait Progress {
    /// One more of `all` cases begins.
    fn begin(&self, name: &str, number: usize, all: usize);
}

/// Rate of the path, and of every tick that is timed.
const PERIOD_NS: u64 = 1_000_000;

/// Measures every case; errors are distances from `reference`, if there is one.
///
/// # Errors
/// [`LoadError`] if the plugin refuses a case or the reference.
pub fn measure(
    plugin: &Plugin,
    cases: &[Case],
    reference: Option<&Case>,
    effort: Effort,
    progress: &dyn Progress,
) -> Result<BenchReport, LoadError> {
    let path = path::smooth(effort.ticks());
    let truth = match reference {
        Some(case) => {
            progress.begin(&format!("reference: {}", case.name), 0, cases.len());
            Some(error::walk(&mut create(plugin, case)?, &path))
        }
        None => None,
    };
    let mut rows = Vec::with_capacity(cases.len());
    for (number, case) in cases.iter().enumerate() {
        progress.begin(&case.name, number + 1, cases.len());
        let mut model = create(plugin, case)?;
        let serves = model.serves();
        let answers = error::walk(&mut model, &path);
        let distance = truth.as_ref().map(|truth| Distance::between(&answers, truth));
        let demands = [Demand::FORCE, Demand::WRENCH, Demand::ALL];
        let times = demands.map(|demand| {
            let demand = demand.limited_to(serves);
            stopwatch::time(&mut model, &path, demand, effort.rounds())
        });
        rows.push(CaseRow { name: case.name.clone(), distance, times });
    }
    let losses = match reference {
        Some(case) => {
            let mut losses = Vec::new();
            for case_used in cases {
                progress.begin(&format!("at the hand: {}", case_used.name), cases.len(), cases.len());
                let mut exact = create(plugin, case)?;
                let mut used = create(plugin, case_used)?;
                losses.push((
                    case_used.name.clone(),
                    reach_hand::losses(&mut exact, &mut used, Sampling::FULL),
                ));
            }
            losses
        }
        None => Vec::new(),
    };
    Ok(BenchReport {
        model: plugin.metadata().id.clone(),
        version: plugin.metadata().version.clone(),
        reference: reference.map(|case| case.name.clone()),
        ticks: path.len(),
        rows,
        losses,
    })
}

fn create(plugin: &Plugin, case: &Case) -> Result<flotor_hal::abi::loader::Model, LoadError> {
    let mut model = plugin.create_model(&case.settings)?;
    let refused = |refusal| {
        let metadata = plugin.metadata().clone();
        LoadError::Refused { path: metadata.path, id: metadata.id, refusal }
    };
    model.prepare(&LoopConfig { period_ns: PERIOD_NS, seed: 0 }).map_err(refused)?;
    Ok(model)
}
