//! Reduction of long lines to the resolution of a picture.
//!
//! The x axis is divided into buckets one pixel wide, and of the samples in a bucket the first, the lowest, the highest and the
//! last are kept. Drawn one pixel per bucket, the reduced line covers the same pixels as the full line (M4 aggregation: Jugel,
//! Jerzak, Hackenbroich, Markl, "M4: A Visualization-Oriented Time Series Data Aggregation", PVLDB 7(10), 2014, section 4).

/// Sample in scale coordinates.
pub(super) type Point = (f64, f64);

/// Splits `samples` at gaps (`None`) into unbroken runs and reduces each to at most four samples per bucket.
///
/// Buckets start at whole multiples of `bucket_width` counted from x = 0 and not from the first sample, so that a curve that grows
/// or scrolls keeps its shape. x need not increase: a bucket ends when a sample leaves it, and a curve that returns starts another
/// bucket.
pub(super) fn decimate(
    samples: impl IntoIterator<Item = Option<Point>>,
    bucket_width: f64,
) -> Vec<Vec<Point>> {
    let mut runs = Vec::new();
    let mut run = Vec::new();
    let mut bucket: Option<Bucket> = None;
    for sample in samples {
        let index = sample.map(|(x, _)| (x / bucket_width).floor());
        match (&mut bucket, sample) {
            (Some(current), Some(point)) if Some(current.index) == index => current.add(point),
            _ => {
                if let Some(done) = bucket.take() {
                    done.append_to(&mut run);
                }
                bucket = sample.zip(index).map(|(point, index)| Bucket::new(index, point));
                if sample.is_none() && !run.is_empty() {
                    runs.push(std::mem::take(&mut run));
                }
            }
        }
    }
    if let Some(done) = bucket {
        done.append_to(&mut run);
    }
    if !run.is_empty() {
        runs.push(run);
    }
    runs
}

/// First, lowest, highest and last of consecutive samples, each with its index in the bucket.
struct Bucket {
    index: f64,
    count: usize,
    first: (usize, Point),
    lowest: (usize, Point),
    highest: (usize, Point),
    last: (usize, Point),
}

impl Bucket {
    fn new(index: f64, point: Point) -> Self {
        let only = (0, point);
        Self { index, count: 1, first: only, lowest: only, highest: only, last: only }
    }

    fn add(&mut self, point: Point) {
        let entry = (self.count, point);
        self.count += 1;
        self.last = entry;
        if point.1 < self.lowest.1.1 {
            self.lowest = entry;
        }
        if point.1 > self.highest.1.1 {
            self.highest = entry;
        }
    }

    fn append_to(self, run: &mut Vec<Point>) {
        let mut kept = vec![self.first, self.lowest, self.highest, self.last];
        kept.sort_by_key(|&(place, _)| place);
        kept.dedup_by_key(|&mut (place, _)| place);
        run.extend(kept.into_iter().map(|(_, point)| point));
    }
}
