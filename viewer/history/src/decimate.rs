//! Decimation of traces without a visible change: smallest and largest value of each bucket of time.
//!
//! Buckets lie at whole multiples of their width from time zero, not from the edge of the plot: while a trace scrolls, a sample
//! stays in its bucket and the trace does not shimmer.

use std::collections::VecDeque;

/// Point of a trace: time, s, and value.
pub type Point = [f64; 2];

/// Returns the width of a bucket, s: the smallest power of two not below `span_s / buckets`, so that a small zoom moves no edge of
/// a bucket.
#[must_use]
pub fn bucket_width_s(span_s: f64, buckets: usize) -> f64 {
    let wanted_s = (span_s / buckets.max(1) as f64).max(f64::MIN_POSITIVE);
    wanted_s.log2().ceil().exp2()
}

/// Decimated trace that grows at its end and is trimmed at its beginning. Each point is processed once.
#[derive(Clone, Debug, Default)]
pub struct Buckets {
    width_s: f64,
    kept: VecDeque<Bucket>,
    segment: u32,
}

/// Smallest and largest point of a bucket; `number` is its start time in bucket widths.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    number: f64,
    segment: u32,
    low: Point,
    high: Point,
}

impl Buckets {
    /// Creates an empty trace with buckets of this width, s.
    #[must_use]
    pub fn of_width(width_s: f64) -> Self {
        Self { width_s, kept: VecDeque::new(), segment: 0 }
    }

    /// Returns the width of a bucket, s.
    #[must_use]
    pub fn width_s(&self) -> f64 {
        self.width_s
    }

    /// Starts a new segment: later points are not joined to earlier points.
    pub fn interrupt(&mut self) {
        self.segment = self.segment.wrapping_add(1);
    }

    /// Adds a point that is not earlier than the last point; ignores a point that is not finite.
    pub fn push(&mut self, point: Point) {
        if !point.iter().all(|part| part.is_finite()) {
            return;
        }
        let number = (point[0] / self.width_s).floor();
        match self.kept.back_mut() {
            Some(bucket) if bucket.number == number && bucket.segment == self.segment => {
                if point[1] < bucket.low[1] {
                    bucket.low = point;
                }
                if point[1] > bucket.high[1] {
                    bucket.high = point;
                }
            }
            _ => self.kept.push_back(Bucket { number, segment: self.segment, low: point, high: point }),
        }
    }

    /// Removes the buckets that end before a time, s.
    pub fn forget_before(&mut self, time_s: f64) {
        while self.kept.front().is_some_and(|bucket| (bucket.number + 1.0) * self.width_s < time_s) {
            self.kept.pop_front();
        }
    }

    /// Returns one or two points of each bucket, in order of time, each with the number of its segment.
    pub fn points(&self) -> impl Iterator<Item = (u32, Point)> {
        self.kept.iter().flat_map(|Bucket { low, high, segment, .. }| {
            let [first, second] = if low[0] <= high[0] { [*low, *high] } else { [*high, *low] };
            let points = [Some(first), (first != second).then_some(second)];
            points.into_iter().flatten().map(|point| (*segment, point))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize) -> Vec<Point> {
        (0..count).map(|i| [i as f64 * 1.0e-3, ((i * 7919) % 1009) as f64]).collect()
    }

    fn kept(points: &[Point], span_s: f64, buckets: usize) -> Vec<Point> {
        let mut kept = Buckets::of_width(bucket_width_s(span_s, buckets));
        points.iter().for_each(|point| kept.push(*point));
        kept.points().map(|(_, point)| point).collect()
    }

    #[test]
    fn extremes_survive_and_points_do_not() {
        let points = noise(10_000);
        let kept = kept(&points, 10.0, 500);
        assert!(kept.len() <= 1100 && kept.len() >= 500, "{}", kept.len());
        let extremes = |points: &[Point]| {
            points.iter().fold([f64::MAX, f64::MIN], |[low, high], [_, v]| [low.min(*v), high.max(*v)])
        };
        assert_eq!(extremes(&kept), extremes(&points));
        assert!(kept.is_sorted_by(|a, b| a[0] < b[0]));
    }

    #[test]
    fn a_scrolling_trace_keeps_its_points() {
        let points = noise(10_000);
        let window = |from: usize| kept(&points[from..from + 5000], 5.0, 500);
        let (before, after) = (window(1000), window(1003));
        // All but the buckets at the two edges.
        let inside = |point: &&Point| point[0] > 1.1 && point[0] < 5.9;
        let before: Vec<_> = before.iter().filter(inside).collect();
        assert!(before.len() > 500);
        assert_eq!(before, after.iter().filter(inside).collect::<Vec<_>>());
    }

    #[test]
    fn few_points_and_holes_are_left_alone() {
        let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0]];
        assert_eq!(kept(&points, 2.0, 100), [[0.0, 1.0], [2.0, 3.0]]);
        assert!(kept(&[], 0.0, 0).is_empty());
    }
}
