//! Histograms of timing: lateness and the stages of a tick.

use flotor_plot::{Axis, Bin, Panel, Series};
use flotor_servo::{Durations, Timing};

/// Returns the panels of a run's timing: ticks by lateness and by compute time, and every sixteenth tick by the time of its stages; each
/// has its own, logarithmic axis of time. Not real-time.
pub fn panels(timing: &Timing) -> [Panel; 2] {
    let [read, models, envelope, write] = &timing.stages;
    let whole = histogram()
        .series(Series::histogram("lateness", times(&timing.lateness)))
        .series(Series::histogram("compute", times(&timing.compute)));
    let named = [("read", read), ("models", models), ("envelope", envelope), ("write", write)];
    let stages = named.into_iter().fold(histogram().title("Stages"), |panel, (name, stage)| {
        panel.series(Series::histogram(name, times(stage)))
    });
    [whole.title("Whole tick"), stages]
}

fn histogram() -> Panel {
    Panel::with_x(Axis::log("Time", "µs"), Axis::log("Ticks", ""))
}

/// Counts ticks by their time, µs; times below 10 ns are in the first bar.
fn times(durations: &Durations) -> Vec<Bin> {
    Bin::quarter_octaves(0.01, durations.bins().into_iter().map(|(ns, count)| (ns as f64 * 1.0e-3, count)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_shows_its_lateness_and_its_stages() {
        let mut timing = Timing::default();
        timing.lateness.record(2_000);
        timing.compute.record(900);
        timing.stage(flotor_servo::Stage::Models, 300);
        let figure = flotor_plot::Figure::new("Run", Axis::linear("Time", "s"));
        let svg = panels(&timing).into_iter().fold(figure, flotor_plot::Figure::panel).to_svg();
        for name in ["lateness", "compute", "read", "models", "envelope", "write"] {
            assert!(svg.contains(name), "{name}");
        }
    }
}
