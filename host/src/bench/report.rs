//! The measurements as a table, as CSV, as a picture.

use super::{Distance, Losses, Times};
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
    /// Length of the path, ticks of 1 ms.
    pub ticks: usize,
    /// The cases.
    pub rows: Vec<CaseRow>,
    /// Each case in a whole loop: error of the force at the hand by cause.
    pub losses: Vec<(String, Losses)>,
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

/// What [`CaseRow::times`] demand.
const DEMANDS: [&str; 3] = ["force", "wrench", "all"];
/// A tenth of a tick at 1 kHz, ns: what a model may take without being noticed.
const TENTH_OF_A_TICK_NS: f64 = 1.0e5;

impl BenchReport {
    /// The table for people.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut lines = vec![format!(
            "  {:<26}{:>9}{:>9}{:>9}{:>10}{:>12}{:>11}{:>11}{:>12}",
            "case", "mean", "median", "p99.9", "cold", "force only", "max error", "rms error", "torque rms"
        )];
        lines.push(format!(
            "  {:<26}{:>9}{:>9}{:>9}{:>10}{:>12}{:>11}{:>11}{:>12}",
            "", "ns", "ns", "ns", "ns", "ns", "N", "N", "N m"
        ));
        for CaseRow { name, distance, times: [force, wrench, _] } in &self.rows {
            let errors = distance.map_or_else(
                || format!("{:>11}{:>11}{:>12}", "", "", ""),
                |d| format!("{:>11.1e}{:>11.1e}{:>12.1e}", d.force_max_n, d.force_rms_n, d.torque_rms_nm),
            );
            lines.push(format!(
                "  {name:<26}{:>9.0}{:>9.0}{:>9.0}{:>10.0}{:>12.0}{errors}",
                wrench.mean_ns,
                wrench.warm_median_ns,
                wrench.warm_p999_ns,
                wrench.cold_median_ns,
                force.mean_ns
            ));
        }
        if !self.losses.is_empty() {
            lines.push(String::new());
            lines.push(
                "  rms error of the force at the hand, N: 1 kHz, one tick late, 5 µm sensor".to_owned(),
            );
            lines.push(format!(
                "  {:<26}{:>11}{:>11}{:>13}{:>11}{:>11}",
                "case", "model", "hold", "hold, delay", "sensor", "all"
            ));
            for (name, l) in &self.losses {
                lines.push(format!(
                    "  {name:<26}{:>11.1e}{:>11.1e}{:>13.1e}{:>11.1e}{:>11.1e}",
                    l.model_n, l.hold_n, l.delay_n, l.quantum_n, l.all_n
                ));
            }
        }
        lines.join("\n")
    }

    /// One line a case and demand, for other programs.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut lines = vec![
            "case,demand,mean_ns,warm_median_ns,warm_p999_ns,cold_median_ns,cold_p999_ns,\
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
            for (demand, t) in DEMANDS.iter().zip(&row.times) {
                lines.push(format!(
                    "\"{}\",{demand},{:.1},{:.1},{:.1},{:.1},{:.1},{errors},{at_hand}",
                    row.name, t.mean_ns, t.warm_median_ns, t.warm_p999_ns, t.cold_median_ns, t.cold_p999_ns
                ));
            }
        }
        lines.join("\n") + "\n"
    }

    /// Error over time, a point a case: the further down and left, the better.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let title = format!("Work and precision of {} {}", self.model, self.version);
        let reference = self.reference.as_deref().unwrap_or("none");
        let force = Panel::new(Axis::log("Force, rms error", "N"));
        // What a 1 kHz loop loses with an exact model: precision far below this line never reaches the hand.
        let force = match self.losses.first() {
            Some((_, losses)) => force.mark(Mark::at_y(losses.delay_n, "hold, delay")),
            None => force,
        };
        let torque = Panel::new(Axis::log("Torque, rms error", "N·m"));
        let (force, torque) = self.rows.iter().fold((force, torque), |(force, torque), row| {
            let [_, wrench, _] = row.times;
            let Some(distance) = row.distance else { return (force, torque) };
            let point = |error: f64| [(wrench.mean_ns, error)];
            (
                force.series(Series::points(row.name.clone(), point(distance.force_rms_n))),
                torque.series(Series::points(row.name.clone(), point(distance.torque_rms_nm))),
            )
        });
        Figure::new(title, Axis::log("Mean time of a tick with force and torque", "ns"))
            .subtitle(format!(
                "smooth path of 1 to 3 Hz at 1 kHz, {} ticks; reference: {reference}; a tenth of a tick is {:.0} ns",
                self.ticks, TENTH_OF_A_TICK_NS
            ))
            .panel_height_px(220.0)
            .panel(force)
            .panel(torque)
            .to_svg()
    }
}
