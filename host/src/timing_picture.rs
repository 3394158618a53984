//! Histograms of timing: lateness and the stages of a tick.

use flotor_plot::{Axis, Bin, Panel, Series};
use flotor_servo::{Durations, Timing};

/// Returns two panels with histograms of a run's timing: lateness and compute time of all ticks, and stage times of every sixteenth
/// tick. Each panel has a logarithmic time axis of its own. Not real-time.
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

/// Returns the histogram of a time, µs; times below 10 ns are in the first bin.
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
