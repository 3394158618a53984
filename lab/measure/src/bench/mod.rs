//! Work against precision: cost and error of an evaluation of a force model, for many of its settings.
//!
//! Every case is evaluated along one smooth path (1 to 3 Hz in all six coordinates, 1 kHz) and through a whole
//! workspace, and is timed four ways: continuously (the mean of a tick), in a batch, call by call (median and p99.9),
//! and cold (after a reset, each call at another pose). All cases take turns, so that comparisons between them do not
//! depend on other load of the machine. An error is the distance from a reference on the same path: another setting of
//! the same model, computed in this run, not a table.
//!
//! - `path`: motions. `times`: timing. `split`: times of two kinds of calls. `error`: distance from the reference.
//!   `front`: Pareto front of the cases over the workspace.
//! - `reach_hand`: error of the force on a hand, through sampling and delay of the whole loop.
//! - `tables`: table, CSV and picture.
//! - `whole_tick`: cost of the loop around a model, on a [`scripted`] device and on the simulated flotor.
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
use flotor_judge::subject::prepared;
use flotor_loader::{LoadError, Model, Plugin, Setting};

/// Named settings of the model, or of another model, to be measured.
#[derive(Clone)]
pub struct Case {
    /// Name in the table.
    pub name: String,
    /// Settings of the model.
    pub settings: Vec<Setting>,
    /// Plugin of another model on the same path; `None`: the measured plugin.
    pub other: Option<Plugin>,
}

/// Returns length of the path, ticks, and number of repetitions: enough for a median, or for p99.9.
const fn extent(size: Size) -> (usize, usize) {
    match size {
        Size::Short => (2_000, 5),
        Size::Full => (20_000, 9),
    }
}

/// Cases, reference and motions of a measurement.
#[derive(Clone)]
pub struct Plan {
    /// Measured cases.
    pub cases: Vec<Case>,
    /// Index of the baseline case of the times.
    pub baseline: usize,
    /// Reference case of the errors; `None`: no errors are measured.
    pub reference: Option<Case>,
    /// Motion of the hand.
    pub hand: Hand,
    /// Workspace of the Pareto front; `None` without a reference.
    pub workspace: Option<Workspace>,
    /// Detail that splits calls; `None`: no split.
    pub split: Option<Split>,
    /// Extent of the measurement.
    pub size: Size,
}

/// Detail of the answer that splits calls into two kinds, with the cases and workspaces to measure.
#[derive(Clone)]
pub struct Split {
    /// Id of the detail. Calls with a value above zero are of the first kind, all other calls of the second.
    pub detail: String,
    /// Cases, each with its workspace.
    pub walks: Vec<(Case, Workspace)>,
}

/// Measured demands: force only, force and torque, and all outputs of a case.
const DEMANDS: [(&str, Demand); 3] =
    [("force", Demand::FORCE), ("wrench", Demand::WRENCH), ("all", Demand::ALL)];

/// Measures the cases of a plan. Not real-time.
///
/// # Errors
/// [`LoadError`] if the plugin rejects a case or the reference.
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
