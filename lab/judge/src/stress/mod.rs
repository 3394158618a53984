//! Numerical stability score of a force model: measures of whether a law is safe for a hand at a thousand ticks a second.
//!
//! | measure | question | source |
//! |---|---|---|
//! | M0 `totality` | does it answer everywhere, finite, without panic? | |
//! | M1 `continuity` | does the wrench jump? | bisection down to 1e-8 mm |
//! | M2 `stiffness` | how steep is it, where may a loop render it? | `K <= 2 b / T`, Colgate and Schenkel 1997 |
//! | M3 `stiffness` | is its derivative symmetric? | Maxwell's reciprocity |
//! | M4 `energy` | do closed motions generate no energy, at rest and in motion? | |
//! | M5 `stiffness` | which damping dissipates what the zero-order hold generates? | `K T / 2`, Colgate and Schenkel 1997 |
//! | M6 `closed_loop` | does a released device settle where theory says it must? | Gil et al. 2009 |
//! | M7 `cost` | how long does a call take? | a tenth of a 1 kHz tick |
//! | M8 `determinism` | same poses, same bits? | |
//! | M9 `search` | what does a search for the worst find? | evolution strategy, Rechenberg 1973 |
//! | M10 `symmetry` | does it keep a symmetry that is declared for it? | |
//! | M11 `asynchronous` | do its contacts or its local linear model pull, where it is computed at a rate of its own? | |
//!
//! Each measure creates its own instances through the plugin contract, without knowledge of the model beyond the
//! contract. Data flows one way: `poses` and `trajectory` generate poses, `subject` calls the model, `sweep`
//! distributes the work over the processors, each measure's module judges, `parts` runs it in its own process, `score`
//! and `picture` present the result.
//!
//! Not real-time: everything here allocates and may take long.

mod asynchronous;
mod closed_loop;
mod continuity;
mod cost;
mod determinism;
mod energy;
mod jacobian;
mod lap;
mod measure;
mod motion;
mod parts;
mod picture;
mod poses;
mod quadrature;
mod score;
mod search;
mod stiffness;
mod sweep;
mod symmetry;
mod totality;

#[cfg(test)]
mod tests;

pub use crate::tally::Decades;
pub use continuity::Jump;
pub use measure::{Measure, PoseRecord, Quantity, Verdict};
pub use parts::{Part, deliver, score_in_processes};
pub use poses::Reach;
pub use score::{Distributions, StressReport};
pub use symmetry::Symmetry;

use crate::subject::Subject;
use crate::{Progress, Size};
use flotor_hal::Memory;
use flotor_loader::{LoadError, Plugin, Setting};

/// Reference period of the loop, s.
const PERIOD_S: f64 = 1.0e-3;
/// Damping of the device, N s/m: light eddy-current drag, and that of the simulated flotor.
const DAMPINGS_NS_PER_M: [f64; 2] = [0.5, 2.0];
/// Lever arm at which the device resists rotation as it resists translation, m: drag spread evenly over a hemisphere of
/// 115 mm radius, `sqrt(2/3) R`. Angles times this are lengths, torques over this are forces.
const LEVER_M: f64 = 0.0939;
/// Fraction of a sample that counts as all of it: tolerates laws that are too stiff for a device with heavy damping, or
/// without a derivative, in few places only.
const MOSTLY: f64 = 0.9;
/// Size of the tested region relative to the workspace: hands overshoot and sensors err.
const WIDER: f64 = 1.5;

/// Settings of a stress test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressOptions {
    /// Extent of the measurements.
    pub size: Size,
    /// Seed of poses and motions.
    pub seed: u64,
    /// Workspace in the model frame.
    pub reach: Reach,
    /// Symmetry to check in M10; `None`: M10 is left out.
    pub symmetry: Option<Symmetry>,
}

impl Default for StressOptions {
    fn default() -> Self {
        Self { size: Size::Short, seed: 1, reach: Reach::default(), symmetry: None }
    }
}

/// Context of all measures.
struct Setup<'a> {
    plugin: &'a Plugin,
    settings: &'a [Setting],
    options: StressOptions,
    /// Divisor of the full effort.
    part: u64,
    progress: &'a dyn Progress,
}

impl<'a> Setup<'a> {
    /// Returns the number of samples: `full` over the divisor, but at least `least`.
    fn share(&self, full: u64, least: u64) -> u64 {
        (full / self.part).max(least)
    }

    fn subject(&self) -> Result<Subject<'a>, LoadError> {
        Subject::new(self.plugin, self.settings, self.options.seed)
    }
}

/// Returns the divisor of the full effort, which is about 2e8 calls for a stateless model. A model with memory needs
/// some hundred calls to walk from one pose to the next, and gets a hundredth of the poses.
fn part_of(size: Size, memory: Memory) -> u64 {
    let by_size = if size == Size::Full { 1 } else { 100 };
    by_size * if memory == Memory::Stateless { 1 } else { 100 }
}

#[cfg(test)]
fn measure_all(setup: &Setup<'_>) -> Result<StressReport, LoadError> {
    use crate::tally::Merge;

    let mut found = parts::Found::default();
    let model = setup.plugin.create_model(setup.settings)?;
    for part in Part::all(&setup.options, &model) {
        found.merge(parts::measure(setup, part)?);
    }
    Ok(StressReport::new(setup, found.measures, found.spread))
}
