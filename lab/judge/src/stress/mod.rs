//! The numerical stability score of a force model: ten measures that tell whether a law may be let loose on
//! a hand a thousand times a second.
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
//!
//! Each measure is made on instances of its own through the plugin contract, with nothing known about the
//! model but what the contract says. Data flows one way: `poses` and `trajectory` say where, `subject` asks,
//! `sweep` shares the work between the processors, each measure's module judges, `parts` runs it in a process of its own,
//! `score` and `picture` show.
//!
//! Not real-time: everything here allocates and takes its time.

mod closed_loop;
mod continuity;
mod cost;
mod determinism;
mod energy;
mod jacobian;
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
use flotor_hal::abi::loader::{LoadError, Plugin, Setting};

/// Period of the loop the score has in mind, s.
const PERIOD_S: f64 = 1.0e-3;
/// Damping of the device, N s/m: light eddy-current drag, and the simulated flotor's.
const DAMPINGS_NS_PER_M: [f64; 2] = [0.5, 2.0];
/// Lever arm at which the device resists rotation as it resists translation, m: drag spread evenly over a
/// hemisphere of 115 mm radius, `sqrt(2/3) R`. Angles times this are lengths, torques over this are forces.
const LEVER_M: f64 = 0.0939;
/// Share of a sample that stands for all of it: of a law that is only here and there too stiff for a device with heavy
/// damping, or has no derivative only here and there.
const MOSTLY: f64 = 0.9;
/// How much wider than the workspace the model is asked: a hand overshoots, a sensor lies.
const WIDER: f64 = 1.5;

/// What to ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressOptions {
    /// How much is asked.
    pub size: Size,
    /// Seed of poses and motions.
    pub seed: u64,
    /// The workspace in the model frame.
    pub reach: Reach,
    /// A symmetry that the model declares.
    pub symmetry: Option<Symmetry>,
}

impl Default for StressOptions {
    fn default() -> Self {
        Self { size: Size::Short, seed: 1, reach: Reach::default(), symmetry: None }
    }
}

/// Everything the measures share.
struct Setup<'a> {
    plugin: &'a Plugin,
    settings: &'a [Setting],
    options: StressOptions,
    /// Of the full effort one part in so many.
    part: u64,
    progress: &'a dyn Progress,
}

impl<'a> Setup<'a> {
    /// How often to ask, of so often in a full run: fewer than the least would be no measurement.
    fn share(&self, full: u64, least: u64) -> u64 {
        (full / self.part).max(least)
    }

    fn subject(&self) -> Result<Subject<'a>, LoadError> {
        Subject::new(self.plugin, self.settings, self.options.seed)
    }
}

/// In full about 2e8 calls for a model without history. One with history is walked, some hundred calls between two
/// poses, and gets a hundredth of the poses.
fn part_of(size: Size, memory: Memory) -> u64 {
    let by_size = if size == Size::Full { 1 } else { 100 };
    by_size * if memory == Memory::Stateless { 1 } else { 100 }
}

#[cfg(test)]
fn measure_all(setup: &Setup<'_>) -> Result<StressReport, LoadError> {
    let mut found = parts::Found::default();
    for part in Part::all(&setup.options) {
        found.add(parts::measure(setup, part)?);
    }
    Ok(StressReport::new(setup, found.measures, found.spread))
}
