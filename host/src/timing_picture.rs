//! How time was kept, as histograms: lateness and the stages of a tick.

use flotor_hal::math;
use flotor_plot::{Axis, Bin, Panel, Series};
use flotor_servo::Timing;

/// Ticks by lateness and by compute time, and every sixteenth tick by the time of its stages; each panel has its own,
/// logarithmic axis of time. Not real-time.
#[must_use]
pub fn panels(timing: &Timing) -> [Panel; 2] {
    let [read, models, envelope, write] = &timing.stages;
    let whole = histogram()
        .series(Series::histogram("lateness", octaves(&timing.lateness.bins())))
        .series(Series::histogram("compute", octaves(&timing.compute.bins())));
    let named = [("read", read), ("models", models), ("envelope", envelope), ("write", write)];
    let stages = named.into_iter().fold(histogram().title("Stages"), |panel, (name, stage)| {
        panel.series(Series::histogram(name, octaves(&stage.bins())))
    });
    [whole.title("Whole tick"), stages]
}

fn histogram() -> Panel {
    Panel::with_x(Axis::log("Time", "µs"), Axis::log("Ticks", "1"))
}

/// Bins of a quarter octave from 10 ns up, of bins of ns and how often: what is shorter than that takes no time.
pub(crate) fn octaves(bins: &[(u64, u64)]) -> Vec<Bin> {
    const FIRST_US: f64 = 0.01;
    const STEP: f64 = 1.189_207_115_002_721; // 2^(1/4)
    let mut heights = Vec::new();
    for (ns, count) in bins {
        let us = *ns as f64 * 1.0e-3;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most some two hundred bins
        let index = (4.0 * math::log2((us / FIRST_US).max(1.0))).floor() as usize;
        if heights.len() <= index {
            heights.resize(index + 1, 0.0);
        }
        if let Some(height) = heights.get_mut(index) {
            let count = *count as f64;
            *height += count;
        }
    }
    let mut from = FIRST_US;
    let bin = |height| {
        let bin = Bin { from, to: from * STEP, height };
        from *= STEP;
        bin
    };
    heights.into_iter().map(bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tick_is_in_the_bin_of_its_time() {
        let bins = octaves(&[(1, 5), (9, 2), (1_000, 7), (1_000_000, 1)]);
        let count = |us: f64| bins.iter().find(|bin| bin.from <= us && us < bin.to).map(|bin| bin.height);
        assert_eq!(count(0.01), Some(7.0), "what is shorter than 10 ns");
        assert_eq!(count(1.0), Some(7.0));
        assert_eq!(count(1000.0), Some(1.0));
        assert_eq!(bins.iter().map(|bin| bin.height).sum::<f64>(), 15.0);
    }

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
