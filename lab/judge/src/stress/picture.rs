//! Picture of the score: jumps over piece length, gains over the workspace, loop energies, call times.

use super::lap::CONSERVATIVE;
use super::{DAMPINGS_NS_PER_M, Decades, PERIOD_S, StressReport};
use flotor_plot::{Axis, Bin, Figure, Mark, Panel, Series};

impl StressReport {
    /// Draws the score as SVG. Not real-time.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let verdicts: Vec<String> = self
            .measures
            .iter()
            .map(|measure| format!("{} {}", measure.id, measure.verdict.word()))
            .collect();
        let subject = format!("{} {}", self.model, self.settings_text());
        let title = format!("Stability score of {}: {:.2}", subject.trim_end(), self.score);
        Figure::new(title, Axis::log("Length of a piece", "mm"))
            .subtitle(format!("{}, seed {}; {}", self.size.word(), self.seed, verdicts.join(", ")))
            .columns(2)
            .panel_height_px(220.0)
            .panel(self.jumps())
            .panel(self.gains())
            .panel(self.loops())
            .panel(self.calls())
            .to_svg()
    }

    fn jumps(&self) -> Panel {
        let jumps = &self.distributions.jumps;
        let force = jumps.iter().map(|jump| (jump.length_mm, jump.force_n));
        let torque = jumps.iter().map(|jump| (jump.length_mm, jump.torque_nm));
        Panel::with_x(
            Axis::log("Length of a piece", "mm"),
            Axis::log("M1: largest change over a piece", "N, N·m"),
        )
        .series(Series::line("force", force))
        .series(Series::line("torque", torque))
    }

    fn gains(&self) -> Panel {
        let panel = Panel::with_x(
            Axis::log("Largest gain at a pose", "N/m"),
            Axis::log("M2: poses of the workspace", ""),
        )
        .series(histogram(&self.distributions.gains_n_per_m));
        DAMPINGS_NS_PER_M.into_iter().fold(panel, |panel, damping| {
            panel.mark(Mark::at_x(2.0 * damping / PERIOD_S, format!("2b/T, b = {damping}")))
        })
    }

    fn loops(&self) -> Panel {
        let x = Axis::log("Work on the hand over work exchanged", "");
        Panel::with_x(x, Axis::log("M4: loops", ""))
            .series(histogram(&self.distributions.loop_energies))
            .mark(Mark::at_x(CONSERVATIVE, "conservative"))
    }

    fn calls(&self) -> Panel {
        Panel::with_x(Axis::log("Time of a call", "ns"), Axis::log("M7: poses", ""))
            .series(histogram(&self.distributions.calls_ns))
    }
}

fn histogram(decades: &Decades) -> Series {
    let bins = decades.bins().into_iter().map(|(from, to, count)| Bin { from, to, height: count as f64 });
    Series::histogram("", bins.filter(|bin| bin.height > 0.0))
}
