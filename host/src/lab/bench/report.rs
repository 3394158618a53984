//! The measurements as a table, as CSV, as a picture.

use super::{Apart, DEMANDS, Distance, Losses, Speed, Times};
use crate::plot::{Axis, Figure, Mark, Panel, Series};
use serde::Serialize;

/// Everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct BenchReport {
    /// Id of the model.
    pub model: String,
    /// Version of its plugin.
    pub version: String,
    /// Case that errors are measured against.
    pub reference: Option<String>,
    /// Case whose times those of the others are compared with.
    pub yardstick: Option<String>,
    /// Length of the path, ticks of 1 ms.
    pub ticks: usize,
    /// The cases.
    pub rows: Vec<CaseRow>,
    /// Each case in a whole loop: error of the force at the hand by cause.
    pub losses: Vec<(String, Losses)>,
    /// Calls of two kinds told apart.
    pub apart: Vec<ApartRow>,
}

/// A case.
#[derive(Clone, Debug, Serialize)]
pub struct CaseRow {
    /// Its name.
    pub name: String,
    /// Distance from the reference.
    pub distance: Option<Distance>,
    /// Times for force only, force and torque, and everything the case serves.
    pub times: [Times; 3],
}

/// Two kinds of calls of a case.
#[derive(Clone, Debug, Serialize)]
pub struct ApartRow {
    /// Name of the case.
    pub name: String,
    /// How far below home the middle of its path lies, m.
    pub depth_m: f64,
    /// The detail that tells them apart.
    pub detail: String,
    /// The times.
    pub apart: Apart,
}

impl BenchReport {
    /// The tables for people.
    #[must_use]
    pub fn to_text(&self) -> String {
        let tables = [self.times(), self.errors(), self.at_the_hand(), self.told_apart()];
        tables
            .into_iter()
            .filter(|lines| !lines.is_empty())
            .map(|lines| lines.join("\n"))
            .collect::<Vec<_>>()
            .join("\n\n")
    }

    fn times(&self) -> Vec<String> {
        let yardstick = self.yardstick.as_deref().unwrap_or("itself");
        let mut lines = vec![
            format!(
                "  Times of a tick with force and torque, ns; all cases in turns, share is that of {yardstick}, median of turns"
            ),
            format!(
                "  {:<24}{:>9}{:>8}{:>9}{:>10}{:>9}{:>12}{:>9}{:>7}",
                "case", "mean", "share", "median", "p99.9", "cold", "force only", "batch", "gain"
            ),
        ];
        lines.extend(self.rows.iter().map(|CaseRow { name, times: [force, wrench, _], .. }| {
            let batch = wrench.batch_ns.map_or_else(String::new, |ns| format!("{ns:.0}"));
            let gain = wrench.batch_gain.map_or_else(String::new, |gain| format!("{gain:.1}"));
            format!(
                "  {name:<24}{:>9.0}{:>8.2}{:>9.0}{:>10.0}{:>9.0}{:>12.0}{batch:>9}{gain:>7}",
                wrench.mean_ns,
                wrench.of_yardstick,
                wrench.warm_median_ns,
                wrench.warm_p999_ns,
                wrench.cold_median_ns,
                force.mean_ns
            )
        }));
        lines
    }

    fn errors(&self) -> Vec<String> {
        let Some(reference) = &self.reference else { return Vec::new() };
        let mut lines = vec![
            format!("  Errors against {reference}"),
            format!(
                "  {:<24}{:>13}{:>13}{:>15}{:>15}",
                "case", "force max N", "rms N", "torque max N m", "rms N m"
            ),
        ];
        lines.extend(self.rows.iter().filter_map(|CaseRow { name, distance, .. }| {
            let Distance { force_max_n, force_rms_n, torque_max_nm, torque_rms_nm, .. } = (*distance)?;
            Some(format!(
                "  {name:<24}{force_max_n:>13.1e}{force_rms_n:>13.1e}{torque_max_nm:>15.1e}{torque_rms_nm:>15.1e}"
            ))
        }));
        lines
    }

    fn at_the_hand(&self) -> Vec<String> {
        if self.losses.is_empty() {
            return Vec::new();
        }
        let mut lines = vec![
            "  Error of the force at the hand, rms, N: 1 kHz, one tick late, 5 µm sensor".to_owned(),
            format!(
                "  {:<24}{:>11}{:>11}{:>13}{:>11}{:>11}",
                "case", "model", "hold", "hold, delay", "sensor", "all"
            ),
        ];
        lines.extend(self.losses.iter().map(|(name, l)| {
            format!(
                "  {name:<24}{:>11.1e}{:>11.1e}{:>13.1e}{:>11.1e}{:>11.1e}",
                l.model_n, l.hold_n, l.delay_n, l.quantum_n, l.all_n
            )
        }));
        lines
    }

    fn told_apart(&self) -> Vec<String> {
        let Some(ApartRow { detail, .. }) = self.apart.first() else { return Vec::new() };
        let mut lines = vec![
            format!("  Calls with {detail} above zero, and the others: times, ns"),
            format!(
                "  {:<24}{:>10}{:>9}{:>11}{:>9}{:>13}{:>9}",
                "case", "depth mm", "share %", "mean", "p99", "others: mean", "p99"
            ),
        ];
        let two = |speed: Option<Speed>| match speed {
            Some(Speed { mean_ns, p99_ns }) => [format!("{mean_ns:.0}"), format!("{p99_ns:.0}")],
            None => ["-".to_owned(), "-".to_owned()],
        };
        lines.extend(self.apart.iter().map(|ApartRow { name, depth_m, apart, .. }| {
            let ([mean, p99], [others, others_p99]) = (two(apart.above), two(apart.others));
            format!(
                "  {name:<24}{:>10.1}{:>9.1}{mean:>11}{p99:>9}{others:>13}{others_p99:>9}",
                depth_m * 1e3,
                apart.share * 100.0
            )
        }));
        lines
    }

    /// One line a case and demand, for other programs.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut lines = vec![
            "case,demand,mean_ns,of_yardstick,batch_ns,batch_gain,warm_median_ns,warm_p999_ns,cold_median_ns,cold_p999_ns,\
             force_max_n,force_rms_n,torque_max_nm,torque_rms_nm,unanswered,hand_rms_n"
                .to_owned(),
        ];
        for row in &self.rows {
            let errors = row.distance.map_or_else(
                || ",,,,".to_owned(),
                |d| {
                    let Distance { force_max_n, force_rms_n, torque_max_nm, torque_rms_nm, unanswered } = d;
                    format!(
                        "{force_max_n:e},{force_rms_n:e},{torque_max_nm:e},{torque_rms_nm:e},{unanswered}"
                    )
                },
            );
            let at_hand = self.losses.iter().find(|(name, _)| *name == row.name);
            let at_hand = at_hand.map_or_else(String::new, |(_, losses)| format!("{:e}", losses.all_n));
            for ((demand, _), t) in DEMANDS.iter().zip(&row.times) {
                let batch_ns = t.batch_ns.map_or_else(String::new, |ns| format!("{ns:.1}"));
                let batch_gain = t.batch_gain.map_or_else(String::new, |gain| format!("{gain:.3}"));
                lines.push(format!(
                    "\"{}\",{demand},{:.1},{:.4},{batch_ns},{batch_gain},{:.1},{:.1},{:.1},{:.1},{errors},{at_hand}",
                    row.name, t.mean_ns, t.of_yardstick, t.warm_median_ns, t.warm_p999_ns, t.cold_median_ns, t.cold_p999_ns
                ));
            }
        }
        lines.join("\n") + "\n"
    }

    /// Error over time, a point a case: the further down and left, the better.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let title = format!("Work and precision of {} {}", self.model, self.version);
        let against = match &self.reference {
            Some(reference) => format!("errors against {reference}"),
            None => "no errors: there is no reference".to_owned(),
        };
        let force = Panel::new(Axis::log("Force, rms error", "N"));
        // What a 1 kHz loop loses with an exact model: precision far below this line never reaches the hand.
        let force = match self.losses.first() {
            Some((_, losses)) => force.mark(Mark::at_y(losses.delay_n, "lost to delay")),
            None => force,
        };
        let torque = Panel::new(Axis::log("Torque, rms error", "N·m"));
        // The reference itself has no error, and no place on a logarithmic axis.
        let with_errors = self.rows.iter().filter_map(|row| {
            row.distance.filter(|distance| distance.force_rms_n > 0.0).map(|distance| (row, distance))
        });
        let (mut panels, mut in_batches) = ((force, torque), (Vec::new(), Vec::new()));
        for (CaseRow { name, times: [_, wrench, _], .. }, Distance { force_rms_n, torque_rms_nm, .. }) in
            with_errors
        {
            let (force, torque) = panels;
            panels = (
                force.series(Series::points(name.clone(), [(wrench.mean_ns, force_rms_n)])),
                // One legend is enough.
                torque.series(Series::points("", [(wrench.mean_ns, torque_rms_nm)])),
            );
            in_batches.0.extend(wrench.batch_ns.map(|ns| (ns, force_rms_n)));
            in_batches.1.extend(wrench.batch_ns.map(|ns| (ns, torque_rms_nm)));
        }
        let (force, torque) = panels;
        Figure::new(title, Axis::log("Time of a tick with force and torque, or of a pose in a batch", "ns"))
            .subtitle(format!(
                "{} ticks of a smooth path of 1 to 3 Hz at 1 kHz; {against}; a tick has 1 000 000 ns",
                self.ticks
            ))
            .panel_height_px(220.0)
            .panel(force.series(Series::points("in a batch", in_batches.0)))
            .panel(torque.series(Series::points("", in_batches.1)))
            .to_svg()
    }
}
