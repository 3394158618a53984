//! Work against precision: what an evaluation of a force model costs, and how wrong it is, for many settings of it.
//!
//! Every case goes along one smooth path (1 to 3 Hz in all six coordinates, 1 kHz) and through a whole workspace, and is timed four
//! ways: without interruption (the mean of a tick), in a batch, call by call (median and p99.9), and cold (after a reset, each call at
//! another pose). All cases take turns, so that what is reported of one against another does not depend on what else the
//! machine does. An error is the distance from a reference that walks the same path: another setting of the same model,
//! computed in this run, not a table.
//!
//! - `path`: the motions. `times`: the times. `split`: times of two kinds of calls. `error`: the distance from the
//!   reference. `front`: which cases are worth their time over the workspace.
//! - `reach_hand`: the whole loop: what of the reference's force reaches a hand, through sampling and delay.
//! - `tables`: table, CSV and picture.
//! - `whole_tick`: what the loop around a model costs with it, on a [`scripted`] device and on the simulated flotor.
//!
//! Not real-time.

mod error;
mod front;
mod path;
mod reach_hand;
mod round_trip;
pub mod scripted;
mod split;
mod tables;
mod times;
mod whole_tick;

pub use error::Distance;
pub use front::{Front, FrontRow};
pub use path::{Hand, Workspace};
pub use reach_hand::{Losses, Sampling};
pub use round_trip::time_round_trips;
pub use split::{Speed, SplitTimes};
pub use tables::{BenchReport, CaseRow, SplitRow};
pub use times::Times;
pub use whole_tick::{BenchDevice, TickCost, WholeTick};

use super::{Progress, Size};
use flotor_hal::Demand;
use flotor_hal::abi::loader::{LoadError, Model, Plugin, Setting};
use flotor_judge::subject::prepared;

/// One setting of the model.
#[derive(Clone)]
pub struct Case {
    /// What the table calls it.
    pub name: String,
    /// Its settings.
    pub settings: Vec<Setting>,
    /// Another model that is measured beside, along the same path; none: that of all cases.
    pub other: Option<Plugin>,
}

/// Length of the path, ticks, and how often it is walked: enough for a median, or for p99.9.
const fn extent(size: Size) -> (usize, usize) {
    match size {
        Size::Short => (2_000, 5),
        Size::Full => (20_000, 9),
    }
}

/// What is measured.
#[derive(Clone)]
pub struct Plan {
    /// The cases.
    pub cases: Vec<Case>,
    /// The baseline of the times.
    pub baseline: usize,
    /// Reference case of the errors.
    pub reference: Option<Case>,
    /// The hand's motion.
    pub hand: Hand,
    /// The workspace of the Pareto front; `None` without a reference.
    pub workspace: Option<Workspace>,
    /// Calls to split.
    pub split: Option<Split>,
    /// How much is timed.
    pub size: Size,
}

/// Calls to split by a detail of the answer.
#[derive(Clone)]
pub struct Split {
    /// Id of the detail: above zero, or not.
    pub detail: String,
    /// In which cases, each through its workspace.
    pub walks: Vec<(Case, Workspace)>,
}

/// Force only, force and torque, and all that a case serves.
const DEMANDS: [(&str, Demand); 3] =
    [("force", Demand::FORCE), ("wrench", Demand::WRENCH), ("all", Demand::ALL)];

/// Measures what is planned.
///
/// # Errors
/// [`LoadError`] if the plugin refuses a case or the reference.
pub fn measure(plugin: &Plugin, plan: &Plan, progress: &dyn Progress) -> Result<BenchReport, LoadError> {
    let Plan { cases, baseline, reference, hand, workspace, split, size } = plan;
    let (ticks, rounds) = extent(*size);
    let path = hand.poses(ticks);
    let mut models = cases.iter().map(|case| create(plugin, case)).collect::<Result<Vec<_>, _>>()?;
    let mut distances = vec![None; cases.len()];
    let mut losses = Vec::new();
    if let Some(case) = reference {
        let mut exact = create(plugin, case)?;
        progress.begin("errors", cases.len() as u64 + 1);
        let truth = reach_hand::Truth::new(&mut exact, *hand, Sampling::FULL);
        progress.advance(1);
        for ((case, model), distance) in cases.iter().zip(&mut models).zip(&mut distances) {
            let (measured, lost) = truth.measure(model);
            *distance = Some(measured);
            losses.push((case.name.clone(), lost));
            progress.advance(1);
        }
    }
    let [force, wrench, everything] = DEMANDS.map(|(name, demand)| {
        progress.begin(&format!("times: {name}"), rounds as u64);
        times::in_turns(&mut models, *baseline, &path, demand, rounds, || progress.advance(1))
    });
    let times = force.into_iter().zip(wrench).zip(everything);
    let rows = cases.iter().zip(distances).zip(times).map(|((case, distance), ((force, wrench), all))| {
        CaseRow { name: case.name.clone(), distance, times: [force, wrench, all] }
    });
    let rows = rows.collect();
    let mut front = None;
    if let (Some(case), Some(workspace)) = (reference, workspace) {
        let (mut exact, named) = (create(plugin, case)?, cases.iter().map(|case| &*case.name));
        progress.begin("times: workspace", rounds as u64);
        let named: Vec<&str> = named.collect();
        let extent = [ticks, rounds];
        front = Some(Front::measure(&named, &mut models, &mut exact, *baseline, *workspace, extent, || {
            progress.advance(1);
        }));
    }
    let mut split_rows = Vec::new();
    if let Some(Split { detail, walks }) = split {
        progress.begin(detail, walks.len() as u64);
        for (case, workspace) in walks {
            let mut model = create(plugin, case)?;
            let times = split::split_times(&mut model, detail, &workspace.poses(ticks), rounds);
            split_rows.extend(times.map(|apart| SplitRow {
                name: case.name.clone(),
                radius_m: workspace.radius_m,
                detail: detail.clone(),
                apart,
            }));
            progress.advance(1);
        }
    }
    Ok(BenchReport {
        model: plugin.metadata().id.clone(),
        version: plugin.metadata().version.clone(),
        reference: reference.as_ref().map(|case| case.name.clone()),
        yardstick: cases.get(*baseline).map(|case| case.name.clone()),
        ticks: path.len(),
        rows,
        losses,
        front,
        apart: split_rows,
    })
}

fn create(plugin: &Plugin, case: &Case) -> Result<Model, LoadError> {
    prepared(case.other.as_ref().unwrap_or(plugin), &case.settings, 0)
}
