//! Trace of a quantity over time, decimated to visible points and kept from frame to frame: for a running host, each frame
//! processes only the new samples.

use egui_plot::PlotPoint;
use flotor_history::History;
use flotor_history::decimate::{Buckets, bucket_width_s};
use flotor_history::quantity::Quantity;
use std::ops::Range;

/// Decimated traces of a quantity's components.
#[derive(Clone, Debug)]
pub struct Trace {
    quantity: Quantity,
    components: Vec<Buckets>,
    points: Vec<Vec<Vec<PlotPoint>>>,
    /// Time of the last processed sample, s.
    last_s: Option<f64>,
    covered: Range<u64>,
    visited: u64,
}

impl Trace {
    /// Creates an empty trace of a quantity.
    #[must_use]
    pub fn of(quantity: Quantity) -> Self {
        let count = quantity.components().len();
        Self {
            quantity,
            components: vec![Buckets::default(); count],
            points: vec![Vec::new(); count],
            last_s: None,
            covered: 0..0,
            visited: 0,
        }
    }

    /// Returns the quantity of the trace.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Returns the number of samples processed so far.
    #[must_use]
    pub fn visited(&self) -> u64 {
        self.visited
    }

    /// Processes the new samples, and returns the points of each component between two times, s: at most two points for each of
    /// about `buckets` buckets, with values multiplied by `per_si`. A component has a list of points for each stretch without a
    /// gap.
    pub fn points(
        &mut self,
        history: &History,
        span_s: [f64; 2],
        buckets: usize,
        per_si: f64,
    ) -> &[Vec<Vec<PlotPoint>>] {
        let width_s = bucket_width_s(span_s[1] - span_s[0], buckets);
        let first = history.number_at(span_s[0]);
        let is_known = self.covered.start <= first && first <= self.covered.end;
        if !is_known || self.components.first().is_none_or(|known| known.width_s() != width_s) {
            self.components.fill(Buckets::of_width(width_s));
            self.covered = first..first;
            self.last_s = None;
        }
        for sample in history.from_number(self.covered.end).take_while(|sample| sample.time_s() <= span_s[1])
        {
            let time_s = sample.time_s();
            if self.last_s.replace(time_s).is_some_and(|last_s| time_s - last_s > history.gap_s()) {
                self.components.iter_mut().for_each(Buckets::interrupt);
            }
            for (component, buckets) in self.components.iter_mut().enumerate() {
                let value = self.quantity.value(sample, component);
                if value.is_nan() {
                    buckets.interrupt();
                }
                buckets.push([time_s, value]);
            }
            self.covered.end += 1;
            self.visited += 1;
        }
        self.covered.start = first;
        for (buckets, points) in self.components.iter_mut().zip(&mut self.points) {
            buckets.forget_before(span_s[0]);
            points.clear();
            let mut stretch = None;
            for (segment, [time_s, value]) in buckets.points().take_while(|(_, at)| at[0] <= span_s[1]) {
                if stretch.replace(segment) != Some(segment) {
                    points.push(Vec::new());
                }
                if let Some(points) = points.last_mut() {
                    points.push(PlotPoint::new(time_s, value * per_si));
                }
            }
        }
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::{RECORD_WORDS, TickRecord};
    use flotor_history::{Retention, unknown_run};
    use flotor_sync::Words;

    const BUCKETS: usize = 100;

    /// Ticks of a force that has no pattern.
    fn push(history: &mut History, ticks: Range<u64>) {
        for tick in ticks {
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            record.tick = tick;
            record.time_ns = tick * 1_000_000;
            record.commanded.force_n = [(tick * 7919 % 1009) as f64, -(tick as f64), 0.0];
            history.push(&record);
        }
    }

    /// What a trace that has seen nothing before makes of it.
    fn afresh(history: &History, span_s: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
        let component = |k: usize| {
            let samples = history.between(span_s[0], span_s[1]);
            let mut kept = Buckets::of_width(bucket_width_s(span_s[1] - span_s[0], BUCKETS));
            samples.for_each(|s| kept.push([s.time_s(), 2.0 * Quantity::Force.value(s, k)]));
            kept.points().map(|(_, point)| point).collect()
        };
        (0..3).map(component).collect()
    }

    fn shown(trace: &mut Trace, history: &History, span_s: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
        let points = trace.points(history, span_s, BUCKETS, 2.0);
        points.iter().map(|points| points.concat().iter().map(|point| [point.x, point.y]).collect()).collect()
    }

    /// A bucket at the left edge may still know of samples that have left the picture.
    fn inside(points: Vec<Vec<[f64; 2]>>, from_s: f64) -> Vec<Vec<[f64; 2]>> {
        points
            .into_iter()
            .map(|points| points.into_iter().filter(|point| point[0] > from_s).collect())
            .collect()
    }

    #[test]
    fn a_trace_that_scrolls_is_the_one_made_afresh_and_looks_at_each_sample_once() {
        let (mut history, mut trace) =
            (History::new(unknown_run(), Retention::Newest(5000)), Trace::of(Quantity::Force));
        let mut ticks = 0;
        for new in [3000, 16, 1, 0, 17, 900, 4000, 333] {
            push(&mut history, ticks..ticks + new);
            ticks += new;
            let end_s = history.span_s()[1];
            let span_s = [end_s - 2.0, end_s];
            let edge_s = span_s[0] + 2.0 * bucket_width_s(2.0, BUCKETS);
            assert_eq!(
                inside(shown(&mut trace, &history, span_s), edge_s),
                inside(afresh(&history, span_s), edge_s)
            );
        }
        // Of the first 3000, and of the 4000 at once, only what is in the picture.
        assert_eq!(trace.visited(), 2001 + 16 + 1 + 17 + 900 + 2001 + 333);
        assert_eq!(shown(&mut trace, &history, [7.0, 8.2]), shown(&mut trace, &history, [7.0, 8.2]));
    }

    /// Nothing was there: no line may say that something was.
    #[test]
    fn a_gap_is_a_gap() {
        let mut history = History::new(unknown_run(), Retention::All);
        push(&mut history, 0..1000);
        push(&mut history, 7000..8000);
        let mut trace = Trace::of(Quantity::Force);
        let points = trace.points(&history, [0.0, 8.0], BUCKETS, 1.0);
        assert_eq!(points.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
        let [before, after] = points[2].as_slice() else { panic!("two stretches") };
        assert!(before.iter().all(|point| point.x < 1.0) && after.iter().all(|point| point.x >= 7.0));
        assert!(history.seen_at(0.5).is_some() && history.seen_at(7.5).is_some());
        assert!(history.seen_at(3.0).is_none() && history.seen_at(-1.6).is_none());
    }

    #[test]
    fn another_place_or_length_of_time_begins_again() {
        let mut history = History::new(unknown_run(), Retention::All);
        push(&mut history, 0..10_000);
        let mut trace = Trace::of(Quantity::Force);
        for span_s in [[5.0, 8.0], [0.5, 3.5], [0.0, 9.999], [9.0, 9.5], [2.0, 5.0]] {
            assert_eq!(shown(&mut trace, &history, span_s), afresh(&history, span_s), "{span_s:?}");
            let seen = trace.visited();
            let _ = shown(&mut trace, &history, span_s);
            assert_eq!(trace.visited(), seen, "the same picture again");
        }
    }
}
