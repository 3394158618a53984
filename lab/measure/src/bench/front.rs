//! Pareto front of a model's settings over a whole workspace: cost against error, and dominated cases.

use super::error::{Distance, walk};
use super::path::Workspace;
use super::times::{Times, in_turns};
use flotor_hal::Demand;
use flotor_loader::Model;
use serde::Serialize;

/// Cost and error of the cases over one workspace.
#[derive(Clone, Debug, Serialize)]
pub struct Front {
    /// Radius of the workspace, m.
    pub radius_m: f64,
    /// Largest angle of a rotation in the workspace, rad.
    pub rotation_rad: f64,
    /// Results of the cases.
    pub rows: Vec<FrontRow>,
}

/// Result of a case over the workspace.
#[derive(Clone, Debug, Serialize)]
pub struct FrontRow {
    /// Name of the case.
    pub name: String,
    /// Times of calls that demand force and torque.
    pub times: Times,
    /// Error relative to the reference, force and torque.
    pub distance: Distance,
    /// Name of the most accurate case that is no slower and no less accurate; `None` on the Pareto front, and for a case that is
    /// not judged.
    pub dominated_by: Option<String>,
}

impl Front {
    /// Measures the cases, in turns, along a path through the workspace, and compares their wrenches with those of the
    /// reference. `done` is called after every round.
    pub(super) fn measure(
        named: &[&str],
        models: &mut [Model],
        exact: &mut Model,
        baseline: usize,
        workspace: Workspace,
        [ticks, rounds]: [usize; 2],
        done: impl Fn(),
    ) -> Self {
        let path = workspace.poses(ticks);
        let truth = walk(exact, &path);
        let distances: Vec<Distance> =
            models.iter_mut().map(|model| Distance::between(&walk(model, &path), &truth)).collect();
        let times = in_turns(models, baseline, &path, Demand::WRENCH, rounds, done);
        let points: Vec<Point> = times
            .iter()
            .zip(&distances)
            .map(|(times, distance)| Point {
                time_ns: times.mean_ns,
                error_n: if is_judged(distance, &distances) { distance.force_max_n } else { f64::NAN },
            })
            .collect();
        let dominated_by = |point: &Point| Some((*named.get(dominator(*point, &points)?)?).to_owned());
        let rows = named.iter().zip(times).zip(distances).zip(&points);
        let rows = rows.map(|(((name, times), distance), point)| FrontRow {
            name: (*name).to_owned(),
            times,
            distance,
            dominated_by: dominated_by(point),
        });
        let Workspace { radius_m, rotation_rad } = workspace;
        Self { radius_m, rotation_rad, rows: rows.collect() }
    }
}

/// Returns true if a case has an error and no other case has fewer poses without a valid wrench: an error over fewer poses is
/// not comparable.
pub(super) fn is_judged<'d>(distance: &Distance, all: impl IntoIterator<Item = &'d Distance>) -> bool {
    all.into_iter().all(|other| distance.unanswered <= other.unanswered) && !distance.force_max_n.is_nan()
}

/// Cost and error of a case.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    time_ns: f64,
    error_n: f64,
}

impl Point {
    /// Returns true if a point is no worse than another in both respects, and better in one. NaN compares false.
    fn dominates(self, other: Self) -> bool {
        self.time_ns <= other.time_ns && self.error_n <= other.error_n && self != other
    }
}

/// Returns the index of the most accurate point that dominates `point`; `None` on the Pareto front.
fn dominator(point: Point, points: &[Point]) -> Option<usize> {
    let better = points.iter().enumerate().filter(|(_, other)| other.dominates(point));
    better.min_by(|(_, a), (_, b)| a.error_n.total_cmp(&b.error_n)).map(|(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_that_leaves_out_poses_or_answers_none_is_not_judged() {
        let distance = |unanswered, force_max_n| Distance { unanswered, force_max_n, ..Distance::default() };
        let all = [distance(2, 0.1), distance(2, f64::NAN), distance(3, 0.0)];
        assert_eq!(all.each_ref().map(|one| is_judged(one, &all)), [true, false, false]);
    }

    #[test]
    fn the_most_accurate_of_the_better_cases_dominates() {
        let points =
            [[100.0, 0.2], [80.0, 0.2], [90.0, 0.1], [800.0, 1e-6], [1500.0, 1e-4], [60.0, f64::NAN]]
                .map(|[time_ns, error_n]| Point { time_ns, error_n });
        let found = points.map(|point| dominator(point, &points));
        assert_eq!(found, [Some(2), None, None, None, Some(3), None]);
        // Equals do not dominate one another.
        assert_eq!(dominator(points[1], &[points[1], points[1]]), None);
    }
}
