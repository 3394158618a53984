//! The numerical stability score of a force model: nine measures that tell whether a law may be let loose on
//! a hand a thousand times a second.
//!
//! | measure | question | source |
//! |---|---|---|
//! | M0 `totality` | does it answer everywhere, finite, without panic? | |
//! | M1 `continuity` | does the wrench jump? | bisection down to 1e-8 mm |
//! | M2 `stiffness` | how steep is it, where may a loop render it? | `K <= 2 b / T`, Colgate and Schenkel 1997 |
//! | M3 `stiffness` | is its derivative symmetric? | Maxwell's reciprocity |
//! | M4 `energy` | do closed motions cost nothing? | |
//! | M5 `energy` | what does holding a force for a period give away? | passivity observer, Ryu et al. 2004 |
//! | M6 `closed_loop` | does a released device settle where theory says it must? | Gil et al. 2009 |
//! | M7 `cost` | how long does a call take? | a tenth of a 1 kHz tick |
//! | M8 `determinism` | same poses, same bits? | |
//!
//! Each measure is made on instances of its own through the plugin contract, with nothing known about the
//! model but what the contract says. Data flows one way: `poses` and `trajectory` say where, `subject` asks,
//! `sweep` shares the work between the processors, each measure's module judges, `report` and `picture`
//! show.
//!
//! Not real-time: everything here allocates and takes its time.

mod closed_loop;
mod continuity;
mod cost;
mod determinism;
mod energy;
mod jacobian;
mod measure;
mod picture;
mod poses;
mod score;
mod stiffness;
mod sweep;
mod totality;

#[cfg(test)]
mod tests;

pub use super::tally::Decades;
pub use continuity::Jump;
pub use measure::{Measure, PoseRecord, Quantity, Verdict};
pub use poses::Reach;
pub use score::{Distributions, StressReport};

use super::subject::Subject;
use super::{Progress, Size};
use flotor_hal::Memory;
use flotor_hal::abi::loader::{LoadError, Plugin, Setting};

/// Period of the loop the score has in mind, s.
const PERIOD_S: f64 = 1.0e-3;
/// Damping of the device, N s/m: light eddy-current drag, and the simulated flotor's.
const DAMPINGS_NS_PER_M: [f64; 2] = [0.5, 2.0];
/// Lever arm at which the device resists rotation as it resists translation, m: drag spread evenly over a
/// hemisphere of 115 mm radius, `sqrt(2/3) R`. Angles times this are lengths, torques over this are forces.
const LEVER_M: f64 = 0.0939;
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
}

impl Default for StressOptions {
    fn default() -> Self {
        Self { size: Size::Short, seed: 1, reach: Reach::default() }
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
fn part(size: Size, memory: Memory) -> u64 {
    let by_size = if size == Size::Full { 1 } else { 100 };
    by_size * if memory == Memory::Stateless { 1 } else { 100 }
}

/// Scores a model with these settings. Not real-time; takes seconds (short) to minutes (full), on all processors.
///
/// # Errors
/// [`LoadError`] if the plugin is no model or refuses the settings. A model that breaks while it is measured
/// is no error: it is what M0 reports.
pub fn score(
    plugin: &Plugin,
    settings: &[Setting],
    options: &StressOptions,
    progress: &dyn Progress,
) -> Result<StressReport, LoadError> {
    let memory = plugin.create_model(settings)?.memory();
    measure_all(&Setup { plugin, settings, options: *options, part: part(options.size, memory), progress })
}

fn measure_all(setup: &Setup<'_>) -> Result<StressReport, LoadError> {
    let totality = totality::measure(setup)?;
    let (continuity, jumps) = continuity::measure(setup)?;
    let (lipschitz, reciprocity, gains_n_per_m) = stiffness::measure(setup)?;
    let (loops, loop_energies) = energy::measure_loops(setup)?;
    let observer = energy::measure_observer(setup)?;
    let closed_loop = closed_loop::measure(setup)?;
    let (cost, calls_ns) = cost::measure(setup)?;
    let determinism = determinism::measure(setup)?;

    let measures =
        vec![totality, continuity, lipschitz, reciprocity, loops, observer, closed_loop, cost, determinism];
    let distributions = Distributions { jumps, gains_n_per_m, loop_energies, calls_ns };
    Ok(StressReport::new(setup, measures, distributions))
}
