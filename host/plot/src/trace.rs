//! Samples of a line, collected in bounded memory.

use super::axis::LARGEST_DRAWABLE;
use super::decimate::Point;

/// Maximum number of stored samples of a trace: seventeen for each pixel column of a figure.
const CAPACITY: usize = 16_384;

/// Number of buckets over the whole line in a reduction. Each bucket keeps at most six samples, so that a reduction frees about a
/// quarter of the capacity.
const BUCKETS: f64 = 2_048.0;

/// Line of samples with ascending x, added one at a time. Up to 16 384 samples are stored unchanged; when more are added, the line
/// is divided into 2 048 buckets, of which the first, lowest, highest and last sample and the gaps (at most two) are kept. The
/// extremes are exact, and a picture of the trace differs from a picture of all samples by less than a pixel.
///
/// Not real-time: adding a sample may allocate, at most 256 KiB per trace.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    samples: Vec<Point>,
    given: usize,
}

impl Trace {
    /// Adds a sample; a sample that is not finite breaks the line. An x below the previous x is replaced by the previous x.
    pub fn add(&mut self, x: f64, y: f64) {
        if self.samples.len() >= CAPACITY {
            self.reduce();
        }
        let last_x = self.samples.last().map_or(f64::NEG_INFINITY, |last| last.0);
        self.samples.push(if x.abs() <= LARGEST_DRAWABLE { (x.max(last_x), y) } else { (last_x, f64::NAN) });
        self.given += 1;
    }

    /// Returns true if any sample can be drawn.
    #[must_use]
    pub fn has_data(&self) -> bool {
        self.largest().is_some()
    }

    /// Returns the largest magnitude of y among the samples that can be drawn; `None` if there is no such sample.
    #[must_use]
    pub fn largest(&self) -> Option<f64> {
        self.samples.iter().map(|(_, y)| y.abs()).filter(|size| size.is_finite()).reduce(f64::max)
    }

    /// Returns the stored samples, and the number of samples that were added.
    pub(super) fn into_parts(self) -> (Vec<Point>, usize) {
        (self.samples, self.given)
    }

    /// Reduces each bucket to at most six samples: at most 12 294 in total, because x does not decrease.
    fn reduce(&mut self) {
        let samples = std::mem::take(&mut self.samples);
        let ends = samples.first().zip(samples.last());
        let (first_x, last_x) = ends.map_or((0.0, 0.0), |(first, last)| (first.0, last.0));
        let bucket_width = (last_x - first_x) / BUCKETS;
        let bucket_of =
            |x: f64| if bucket_width > 0.0 { ((x - first_x) / bucket_width).floor() } else { 0.0 };
        self.samples.reserve_exact(CAPACITY);
        for bucket in samples.chunk_by(|one, next| bucket_of(one.0) == bucket_of(next.0)) {
            self.samples.extend(kept(bucket));
        }
    }
}

/// Returns the first, lowest, highest and last finite sample of a bucket, its first gap and a gap at its end, in their order.
fn kept(bucket: &[Point]) -> impl Iterator<Item = Point> + '_ {
    let finite = || bucket.iter().enumerate().filter(|(_, (_, y))| y.is_finite());
    let place = |found: Option<(usize, &Point)>| found.map(|(place, _)| place);
    let by_y = |one: &(usize, &Point), other: &(usize, &Point)| one.1.1.total_cmp(&other.1.1);
    let places = [
        place(finite().next()),
        place(finite().min_by(by_y)),
        place(finite().max_by(by_y)),
        place(finite().next_back()),
        bucket.iter().position(|(_, y)| !y.is_finite()),
        bucket.last().filter(|(_, y)| !y.is_finite()).map(|_| bucket.len() - 1),
    ];
    let mut places: Vec<usize> = places.into_iter().flatten().collect();
    places.sort_unstable();
    places.dedup();
    places.into_iter().filter_map(|place| bucket.get(place).copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: impl IntoIterator<Item = Point>) -> Trace {
        let mut trace = Trace::default();
        samples.into_iter().for_each(|(x, y)| trace.add(x, y));
        trace
    }

    /// A line with a single peak of one sample, gaps, and a wave that no pixel resolves.
    fn long(count: u32) -> impl Iterator<Item = Point> {
        (0..count).map(move |index| {
            let x = f64::from(index) * 1e-3;
            let y = match index {
                777_777 => 5.0,
                400_000..420_000 => f64::NAN,
                _ => libm::sin(7.0 * x) + 1e-3 * libm::sin(900.0 * x),
            };
            (x, y)
        })
    }

    #[test]
    fn a_short_trace_keeps_every_sample() {
        let (samples, given) = of(long(16_384)).into_parts();
        assert!(samples.into_iter().eq(long(16_384)));
        assert_eq!(given, 16_384);
    }

    #[test]
    fn a_long_trace_keeps_its_ends_its_extremes_and_its_gap() {
        let (samples, given) = of(long(1_000_000)).into_parts();
        assert_eq!(given, 1_000_000);
        assert!(samples.len() <= CAPACITY && samples.capacity() <= CAPACITY, "{}", samples.capacity());
        let finite = |of: &mut dyn Iterator<Item = Point>| {
            of.map(|(_, y)| y)
                .filter(|y| y.is_finite())
                .fold((f64::MAX, f64::MIN), |(low, high), y| (low.min(y), high.max(y)))
        };
        assert_eq!(finite(&mut samples.iter().copied()), finite(&mut long(1_000_000)), "the extremes");
        assert_eq!(samples.first().copied(), long(1).next());
        assert_eq!(samples.last().copied(), long(1_000_000).last());
        let gap: Vec<f64> = samples.iter().filter(|(_, y)| y.is_nan()).map(|(x, _)| *x).collect();
        assert!(gap.first().is_some_and(|x| (400.0..400.5).contains(x)), "{gap:?}");
        assert!(gap.last().is_some_and(|x| (419.0..420.0).contains(x)), "{gap:?}");
        assert!(samples.windows(2).all(|pair| pair[0].0 < pair[1].0), "in their order");
        // No stretch of a pixel column (1000 s over 900 px) goes without a sample.
        assert!(samples.windows(2).all(|pair| pair[1].0 - pair[0].0 < 1.0));
        assert!(samples.len() > 4_000, "{}", samples.len());
    }

    #[test]
    fn memory_is_bounded_whatever_the_samples() {
        let count = 200_000;
        let gaps = (0..count).map(|index| (f64::from(index), if index % 2 == 0 { f64::NAN } else { 1.0 }));
        let still = (0..count).map(|index| (3.0, f64::from(index)));
        let no_number = (0..count).map(|index| (f64::NAN, f64::from(index)));
        let falling = (0..count).map(|index| (-f64::from(index), 1.0));
        let traces = [of(gaps), of(still), of(no_number), of(falling)];
        for (name, trace) in ["gaps", "one x", "x is NaN", "x falls"].into_iter().zip(traces) {
            let (samples, given) = trace.into_parts();
            assert_eq!(given, 200_000, "{name}");
            assert!(samples.capacity() <= CAPACITY, "{name}: {}", samples.capacity());
        }
    }
}
