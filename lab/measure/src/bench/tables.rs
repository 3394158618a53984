//! Results as table, CSV and picture.

use super::front::is_judged;
use super::{DEMANDS, Distance, Front, FrontRow, Losses, Sampling, Speed, SplitTimes, Times};
use flotor_command::tables::{table, to_csv};
use flotor_plot::{Axis, Bin, Figure, Mark, Panel, Series};
use serde::Serialize;

/// Results of a bench.
#[derive(Clone, Debug, Serialize)]
pub struct BenchReport {
    /// Id of the model.
    pub model: String,
    /// Version of the plugin.
    pub version: String,
    /// Name of the reference case of the errors; `None` without a reference.
    pub reference: Option<String>,
    /// Name of the baseline case of the times; `None` without cases.
    pub yardstick: Option<String>,
    /// Length of the path, ticks of 1 ms.
    pub ticks: usize,
    /// Results of the cases.
    pub rows: Vec<CaseRow>,
    /// Error of the force on the hand by cause, for each case (by name) in a whole loop; empty without a reference.
    pub losses: Vec<(String, Losses)>,
    /// Results over the whole workspace; `None` without a reference.
    pub front: Option<Front>,
    /// Times of calls split by a detail; empty without a split.
    pub apart: Vec<SplitRow>,
}

/// Result of a case.
#[derive(Clone, Debug, Serialize)]
pub struct CaseRow {
    /// Name of the case.
    pub name: String,
    /// Error relative to the reference; `None` without a reference.
    pub distance: Option<Distance>,
    /// Times for force only, force and torque, and all outputs of the case.
    pub times: [Times; 3],
}

/// Times of two kinds of calls of a case.
#[derive(Clone, Debug, Serialize)]
pub struct SplitRow {
    /// Name of the case.
    pub name: String,
    /// Radius of the workspace of its path, m.
    pub radius_m: f64,
    /// Id of the detail that splits the calls.
    pub detail: String,
    /// Times of the two kinds.
    pub apart: SplitTimes,
}

/// Errors of a case in a line of CSV.
#[derive(Serialize)]
#[serde(untagged)]
enum Errors {
    Known(Distance),
    Unknown([(); 5]),
}

/// Formats a table row: a name and numbers.
fn named<const N: usize, const M: usize>(name: &str, numbers: [f64; M]) -> [String; N] {
    let mut cells = std::iter::once(name.to_owned()).chain(numbers.map(|number| format!("{number:.1e}")));
    std::array::from_fn(|_| cells.next().unwrap_or_default())
}

impl BenchReport {
    /// Formats human-readable tables.
    #[must_use]
    pub fn to_text(&self) -> String {
        let tables =
            [self.times(), self.errors(), self.at_the_hand(), self.pareto_front(), self.split_calls()];
        let tables = tables.into_iter().filter(|lines| !lines.is_empty()).map(|lines| lines.join("\n"));
        tables.collect::<Vec<_>>().join("\n\n")
    }

    fn times(&self) -> Vec<String> {
        let baseline = self.yardstick.as_deref().unwrap_or("itself");
        let title = format!(
            "  Times of a tick with force and torque, ns; cases in turns; share: median over all turns, relative to {baseline}"
        );
        let rows = self.rows.iter().map(|CaseRow { name, times: [force, wrench, _], .. }| {
            let [mean, median, p999, cold, force] = [
                wrench.mean_ns,
                wrench.warm_median_ns,
                wrench.warm_p999_ns,
                wrench.cold_median_ns,
                force.mean_ns,
            ]
            .map(|ns| format!("{ns:.0}"));
            let share = format!("{:.2}", wrench.of_yardstick);
            let batch = wrench.batch_ns.map_or_else(String::new, |ns| format!("{ns:.0}"));
            let gain = wrench.batch_gain.map_or_else(String::new, |gain| format!("{gain:.1}"));
            [name.clone(), mean, share, median, p999, cold, force, batch, gain]
        });
        let head = ["case", "mean", "share", "median", "p99.9", "cold", "force only", "batch", "gain"];
        [vec![title], table(head, rows)].concat()
    }

    fn errors(&self) -> Vec<String> {
        let Some(reference) = &self.reference else { return Vec::new() };
        let rows = self.rows.iter().filter_map(|CaseRow { name, distance, .. }| {
            let Distance { force_max_n, force_rms_n, torque_max_nm, torque_rms_nm, .. } = (*distance)?;
            Some(named(name, [force_max_n, force_rms_n, torque_max_nm, torque_rms_nm]))
        });
        let head = ["case", "force max N", "rms N", "torque max N m", "rms N m"];
        let left_out = self.rows.iter().filter_map(|CaseRow { name, distance, .. }| {
            let unanswered = (*distance)?.unanswered;
            (unanswered > 0).then(|| format!("  {name}: {unanswered} poses without a result, not compared"))
        });
        let title = format!("  Errors against {reference}");
        [vec![title], table(head, rows), left_out.collect()].concat()
    }

    fn at_the_hand(&self) -> Vec<String> {
        if self.losses.is_empty() {
            return Vec::new();
        }
        let Sampling { delay_ticks, quantum_m, .. } = Sampling::FULL;
        let title = format!(
            "  Error of the force at the hand, rms, N: 1 kHz, {delay_ticks} tick late, sensor in steps of {:.0} µm",
            quantum_m * 1.0e6
        );
        let rows = self.losses.iter().map(|(name, losses)| {
            let Losses { model_n, hold_n, delay_n, quantum_n, all_n } = *losses;
            named(name, [model_n, hold_n, delay_n, quantum_n, all_n])
        });
        let head = ["case", "model", "hold", "hold, delay", "sensor", "all"];
        [vec![title], table(head, rows)].concat()
    }

    fn pareto_front(&self) -> Vec<String> {
        let Some(Front { radius_m, rotation_rad, rows }) = &self.front else { return Vec::new() };
        let title = format!(
            "  The whole workspace, a ball of {:.1} mm and {:.1}°: time of a tick, largest error, Pareto front",
            radius_m * 1e3,
            rotation_rad.to_degrees()
        );
        let cells = rows.iter().map(|FrontRow { name, times, distance, dominated_by }| {
            let Distance { force_max_n, force_rms_n, torque_max_nm, .. } = *distance;
            let [mean, p999] = [times.mean_ns, times.warm_p999_ns].map(|ns| format!("{ns:.0}"));
            let [max, rms, torque] = [force_max_n, force_rms_n, torque_max_nm].map(|n| format!("{n:.1e}"));
            let place = match dominated_by {
                Some(by) => format!("dominated by {by}"),
                None if is_judged(distance, rows.iter().map(|row| &row.distance)) => "yes".to_owned(),
                None => "not judged".to_owned(),
            };
            [name.clone(), mean, p999, max, rms, torque, place]
        });
        let head = ["case", "mean ns", "p99.9", "force max N", "rms N", "torque max N m", "Pareto front"];
        let unanswered = rows.iter().filter(|row| row.distance.unanswered > 0);
        let left_out = unanswered.map(|FrontRow { name, distance, .. }| {
            format!("  {name}: {} poses without a result, not compared", distance.unanswered)
        });
        let left_out: Vec<String> = left_out.collect();
        [vec![title], table(head, cells), left_out].concat()
    }

    fn split_calls(&self) -> Vec<String> {
        let Some(SplitRow { detail, .. }) = self.apart.first() else { return Vec::new() };
        let two = |speed: Option<Speed>| match speed {
            Some(Speed { mean_ns, p99_ns }) => [format!("{mean_ns:.0}"), format!("{p99_ns:.0}")],
            None => ["-".to_owned(), "-".to_owned()],
        };
        let rows = self.apart.iter().map(|SplitRow { name, radius_m, apart, .. }| {
            let ([mean, p99], [others, others_p99]) = (two(apart.above), two(apart.others));
            let [radius, share] = [radius_m * 1e3, apart.share * 100.0].map(|number| format!("{number:.1}"));
            [name.clone(), radius, share, mean, p99, others, others_p99]
        });
        let title =
            format!("  Calls with {detail} above zero, and other calls: fastest call of each tick, ns");
        let head = ["case", "radius mm", "share %", "mean", "p99", "others: mean", "p99"];
        [vec![title], table(head, rows)].concat()
    }

    /// Formats one line per case and demand as CSV.
    #[must_use]
    pub fn to_csv(&self) -> String {
        const ERRORS: [&str; 6] =
            ["force_max_n", "force_rms_n", "torque_max_nm", "torque_rms_nm", "unanswered", "hand_rms_n"];
        let times = "case,demand,mean_ns,of_yardstick,batch_ns,batch_gain,warm_median_ns,warm_p999_ns,cold_median_ns,\
            cold_p999_ns";
        to_csv(
            times.split(',').chain(ERRORS),
            self.rows.iter().flat_map(|CaseRow { name, distance, times }| {
                let losses = self.losses.iter().find(|(other, _)| other == name);
                let hand_rms_n = losses.map(|(_, losses)| losses.all_n);
                let rows = DEMANDS.iter().zip(times);
                rows.map(move |((demand, _), times)| {
                    (
                        name,
                        demand,
                        times,
                        distance.map_or(Errors::Unknown([(); 5]), Errors::Known),
                        hand_rms_n,
                    )
                })
            }),
        )
    }

    /// Draws error over computing time as SVG, a point per case: the lower and the farther left, the better. Without
    /// errors, draws the times.
    #[must_use]
    pub fn to_svg(&self) -> String {
        if self.rows.iter().all(|row| row.distance.is_none()) {
            return self.times_to_svg();
        }
        let title = format!("Work and precision of {} {}", self.model, self.version);
        let against = match &self.reference {
            Some(reference) => format!("errors against {reference}"),
            None => "no reference".to_owned(),
        };
        let force = Panel::new(Axis::log("Force, rms error", "N"));
        // Error of a 1 kHz loop with an exact model: precision far below this line does not reach the hand.
        let force = match self.losses.first() {
            Some((_, losses)) => force.mark(Mark::at_y(losses.delay_n, "lost to delay")),
            None => force,
        };
        let torque = Panel::new(Axis::log("Torque, rms error", "N·m"));
        // The reference itself has no error, and no place on a logarithmic axis.
        let with_errors: Vec<(&CaseRow, Distance)> = self
            .rows
            .iter()
            .filter_map(|row| Some((row, row.distance.filter(|distance| distance.force_rms_n > 0.0)?)))
            .collect();
        // Only one panel has a legend.
        let drawn = |panel: Panel, has_legend: bool, error: fn(&Distance) -> f64| {
            let name = |name: &str| if has_legend { name.to_owned() } else { String::new() };
            let in_batches =
                with_errors.iter().filter_map(|(CaseRow { times: [_, wrench, _], .. }, distance)| {
                    Some((wrench.batch_ns?, error(distance)))
                });
            let cases = with_errors.iter().fold(
                panel,
                |panel, (CaseRow { name: case, times: [_, wrench, _], .. }, distance)| {
                    panel.series(Series::points(name(case), [(wrench.mean_ns, error(distance))]))
                },
            );
            cases.series(Series::points(name("in a batch"), in_batches))
        };
        let has_torque = with_errors.iter().any(|(_, distance)| distance.torque_rms_nm > 0.0);
        let figure = Figure::new(
            title,
            Axis::log("Time of a tick with force and torque, or of a pose in a batch", "ns"),
        )
        .subtitle(format!(
            "{} ticks of a smooth path of 1 to 3 Hz at 1 kHz; {against}; a tick has 1 000 000 ns",
            self.ticks
        ))
        .panel_height_px(220.0)
        .panel(drawn(force, true, |distance| distance.force_rms_n));
        // A sphere has no torque about its centre.
        let torque = has_torque.then(|| drawn(torque, false, |distance| distance.torque_rms_nm));
        torque.into_iter().fold(figure, Figure::panel).to_svg()
    }

    /// Draws the times of each case as bars, in the order of the table.
    fn times_to_svg(&self) -> String {
        let panel = |title: &str, time: fn(&Times) -> f64| {
            let rows = self.rows.iter().zip(1_u32..);
            rows.fold(
                Panel::new(Axis::linear(title, "ns")),
                |panel, (CaseRow { name, times: [_, wrench, _], .. }, at)| {
                    let (middle, height) = (f64::from(at), time(wrench));
                    panel.series(Series::histogram(
                        name,
                        [Bin { from: middle - 0.4, to: middle + 0.4, height }],
                    ))
                },
            )
        };
        let cases = self.rows.len() as f64;
        Figure::new(
            format!("Time of {} {}", self.model, self.version),
            Axis::linear("Case, in the order of the table", "")
                .range(0.0, cases + 1.0)
                .levels((1_u32..).zip(&self.rows).map(|(case, _)| f64::from(case))),
        )
        .subtitle(format!(
            "A tick with force and torque; {} ticks of a smooth path of 1 to 3 Hz at 1 kHz; no errors: no --reference; a tick has \
             1 000 000 ns",
            self.ticks
        ))
        .panel_height_px(220.0)
        .panel(panel("Mean", |times| times.mean_ns))
        .panel(panel("99.9th percentile", |times| times.warm_p999_ns))
        .to_svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without a reference there are no errors to draw, and a picture all the same.
    #[test]
    fn without_a_reference_the_picture_has_the_times() {
        let times = |mean_ns: f64| Times {
            mean_ns,
            of_yardstick: 1.0,
            batch_ns: None,
            batch_gain: None,
            warm_median_ns: mean_ns,
            warm_p999_ns: 2.0 * mean_ns,
            cold_median_ns: mean_ns,
            cold_p999_ns: mean_ns,
        };
        let row = |name: &str, mean_ns: f64| CaseRow {
            name: name.to_owned(),
            distance: None,
            times: [times(mean_ns), times(mean_ns), times(mean_ns)],
        };
        let report = BenchReport {
            model: "spring".to_owned(),
            version: "0.1.0".to_owned(),
            reference: None,
            yardstick: None,
            ticks: 1000,
            rows: vec![row("variant=energy", 300.0), row("variant=rod", 900.0)],
            losses: Vec::new(),
            front: None,
            apart: Vec::new(),
        };
        let svg = report.to_svg();
        assert!(!svg.contains("no data") && svg.contains("variant=rod") && svg.contains("900"), "{svg}");
        assert!(svg.contains("Mean") && svg.contains("99.9th percentile"));
    }
}
