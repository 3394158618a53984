//! SVG path data in a compact form, and the outlines of series as paths.
//!
//! Coordinates are whole tenths of a pixel. Each step is written relative to the last *rounded* point, so
//! rounding errors do not add up along a line, and a step takes about six characters.

use std::collections::BTreeSet;

use super::axis::Domain;
use super::clip::clipped;
use super::cover::Course;
use super::decimate::{Point, decimate};
use super::series::{Bin, ErrorBar, Series, Shape};
use super::text;
use super::theme::Slot;

/// Ratio of length to width above which a line crosses itself up and down, so that dashes would hide its peaks.
const BUSY_LENGTH_PER_WIDTH: f64 = 4.0;

/// Size of the squares in each of which only one marker is drawn.
const MARKER_CELL_PX: f64 = 1.0;

/// Largest distance of coordinates from the plotting area, in sizes of the area. Farther outside, a point only
/// gives the direction of the line that leaves.
const FARTHEST_FRACTION: f64 = 1000.0;

/// Half the width of the end of an error bar.
const ERROR_CAP_PX: f64 = 5.0;

/// Tolerance for a point on the edge of the frame: half of the rounding of coordinates.
const EDGE_PX: f64 = 0.05;

/// Axis-aligned rectangle in pixels, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Returns the x at a fraction of the width, from the left.
    pub(super) fn x_at(&self, fraction: f64) -> f64 {
        self.left + self.width * fraction
    }

    /// Returns the y at a fraction of the height, from the bottom.
    pub(super) fn y_at(&self, fraction: f64) -> f64 {
        self.bottom() - self.height * fraction
    }

    /// Returns the rectangle, larger on all sides.
    fn grown(&self, by_px: f64) -> Self {
        let Self { left, top, width, height } = self;
        Self {
            left: left - by_px,
            top: top - by_px,
            width: width + 2.0 * by_px,
            height: height + 2.0 * by_px,
        }
    }

    /// Returns true if the point lies in the rectangle or on its edge.
    pub(super) fn contains(&self, point: Point) -> bool {
        self.nearest(point) == point
    }

    /// Returns the point of the rectangle nearest to `point`.
    pub(super) fn nearest(&self, (x, y): Point) -> Point {
        (x.clamp(self.left, self.right()), y.clamp(self.top, self.bottom()))
    }

    /// Returns a line from bottom to top at `x`.
    pub(super) fn upright(&self, x: f64) -> [Point; 2] {
        [(x, self.bottom()), (x, self.top)]
    }

    /// Returns a line from left to right at `y`.
    pub(super) fn level(&self, y: f64) -> [Point; 2] {
        [(self.left, y), (self.right(), y)]
    }
}

/// Path data under construction.
#[derive(Debug, Default)]
pub(super) struct Path {
    data: String,
    at: (f64, f64),
    /// Start and length of a level step at the end of the data, which the next one in the same direction extends.
    level: Option<(usize, f64)>,
}

impl Path {
    pub(super) fn data(&self) -> &str {
        &self.data
    }

    pub(super) fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    fn move_to(&mut self, x: f64, y: f64) {
        self.at = (tenths(x), tenths(y));
        self.level = None;
        self.data.push('M');
        self.push_pair(self.at);
    }

    fn line_to(&mut self, x: f64, y: f64) {
        let to = (tenths(x), tenths(y));
        let step = (to.0 - self.at.0, to.1 - self.at.1);
        self.at = to;
        let level = if step == (0.0, 0.0) { self.level } else { self.level.take() };
        match step {
            (0.0, 0.0) => {}
            (dx, 0.0) => {
                let before = level.filter(|(_, before)| before.is_sign_positive() == dx.is_sign_positive());
                let (start, before) = before.unwrap_or((self.data.len(), 0.0));
                self.data.truncate(start);
                self.data.push('h');
                text::push_tenths(&mut self.data, before + dx);
                self.level = Some((start, before + dx));
            }
            (0.0, dy) => {
                self.data.push('v');
                text::push_tenths(&mut self.data, dy);
            }
            _ => {
                self.data.push('l');
                self.push_pair(step);
            }
        }
    }

    fn push_pair(&mut self, (first, second): (f64, f64)) {
        text::push_tenths(&mut self.data, first);
        if second >= 0.0 {
            self.data.push(' ');
        }
        text::push_tenths(&mut self.data, second);
    }

    fn close(&mut self) {
        self.level = None;
        self.data.push('z');
    }

    /// Adds an open line through the points; a single point becomes a dot of the line's width (with round caps).
    pub(super) fn polyline(&mut self, points: impl IntoIterator<Item = Point>) {
        let mut points = points.into_iter();
        let Some((x, y)) = points.next() else { return };
        self.move_to(x, y);
        let drawn = self.data.len();
        for (x, y) in points {
            self.line_to(x, y);
        }
        if self.data.len() == drawn {
            self.level = None;
            self.data.push_str("h0");
        }
    }

    /// Adds a closed outline through offsets from (x, y).
    pub(super) fn polygon(&mut self, x: f64, y: f64, offsets: &[Point]) {
        self.outline(offsets.iter().map(|&(dx, dy)| (x + dx, y + dy)));
    }

    /// Adds a closed outline through points.
    pub(super) fn outline(&mut self, points: impl IntoIterator<Item = Point>) {
        self.polyline(points);
        self.close();
    }

    pub(super) fn circle(&mut self, x: f64, y: f64, radius: f64) {
        self.arcs(x, y, radius, 1);
    }

    /// Adds a circle with a hole: the inner outline has the opposite direction, so that it is not filled.
    pub(super) fn ring(&mut self, x: f64, y: f64, outer: f64, inner: f64) {
        self.arcs(x, y, outer, 1);
        self.arcs(x, y, inner, 0);
    }

    /// Adds the end of an error bar.
    pub(super) fn error_cap(&mut self, x: f64, y: f64) {
        self.polyline([(x - ERROR_CAP_PX, y), (x + ERROR_CAP_PX, y)]);
    }

    fn arcs(&mut self, x: f64, y: f64, radius: f64, sweep: u8) {
        self.move_to(x - radius, y);
        let (r, d) = (text::px(radius), text::px(2.0 * radius));
        self.data.push_str(&format!("a{r} {r} 0 1 {sweep} {d} 0a{r} {r} 0 1 {sweep}-{d} 0z"));
    }
}

fn tenths(px: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (px * 10.0).round() + 0.0
}

/// Projection from scale coordinates to pixels of one panel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projection {
    pub(super) x: Domain,
    pub(super) y: Domain,
    pub(super) frame: Rect,
}

impl Projection {
    pub(super) fn x_px(&self, coordinate: f64) -> f64 {
        self.frame.x_at(bounded(self.x.fraction(coordinate)))
    }

    pub(super) fn y_px(&self, coordinate: f64) -> f64 {
        self.frame.y_at(bounded(self.y.fraction(coordinate)))
    }

    fn point_px(&self, (x, y): Point) -> Point {
        (self.x_px(x), self.y_px(y))
    }

    fn point(&self, (x, y): (f64, f64)) -> Option<Point> {
        self.x.scale.forward(x).zip(self.y.scale.forward(y))
    }

    /// Returns the width of one pixel column in x coordinates.
    fn column(&self) -> f64 {
        self.x.span() / self.frame.width
    }
}

fn bounded(fraction: f64) -> f64 {
    fraction.clamp(-FARTHEST_FRACTION, FARTHEST_FRACTION)
}

/// Drawing of one series.
#[derive(Debug)]
pub(super) enum Drawing {
    /// A line, and the samples that stand alone between gaps (dashes would swallow them); `busy` if it goes
    /// up and down so much that dashes would hide parts of it. `covers` later lines are over it.
    Line { path: Path, dots: Path, busy: bool, course: Course, covers: usize },
    /// Filled marker outlines.
    Markers(Path),
    /// A filled outline standing on the axis.
    Bars(Path),
    /// Upright strokes with caps.
    Errors(Path),
}

/// Draws `series`; returns `None` if no sample can be drawn.
pub(super) fn draw(series: &Series, slot: Slot, projection: &Projection) -> Option<Drawing> {
    let drawing = match &series.shape {
        Shape::Line(samples) => {
            line(samples.iter().map(|&sample| projection.point(sample)), slot, projection)
        }
        Shape::Steps(samples) => {
            line(corners(samples.iter().map(|&sample| projection.point(sample))), slot, projection)
        }
        Shape::Points(samples) => markers(samples, slot, projection),
        Shape::Histogram(bins) => bars(bins, projection),
        Shape::Errors(bars) => errors(bars, projection),
    };
    let is_empty = match &drawing {
        Drawing::Line { path, dots, .. } => path.is_empty() && dots.is_empty(),
        Drawing::Markers(path) | Drawing::Bars(path) | Drawing::Errors(path) => path.is_empty(),
    };
    (!is_empty).then_some(drawing)
}

fn line(samples: impl Iterator<Item = Option<Point>>, slot: Slot, projection: &Projection) -> Drawing {
    let runs: Vec<Vec<Point>> = decimate(samples, projection.column())
        .into_iter()
        .map(|run| run.into_iter().map(|point| projection.point_px(point)).collect())
        .flat_map(|run: Vec<Point>| clipped(&run, &projection.frame.grown(EDGE_PX)))
        .collect();
    let (mut path, mut dots) = (Path::default(), Path::default());
    if let [only_run] = runs.as_slice()
        && let [(x, y)] = only_run.as_slice()
    {
        slot.add_marker(&mut path, *x, *y);
        return Drawing::Markers(path);
    }
    // A faint line neither covers others nor counts as covered.
    let course = if slot.is_faint() { Course::default() } else { Course::of(&runs, &projection.frame) };
    let busy = is_busy(&runs);
    for run in runs {
        let target = if run.len() == 1 { &mut dots } else { &mut path };
        target.polyline(run);
    }
    Drawing::Line { path, dots, busy, course, covers: 0 }
}

/// Returns true if the lines are much longer than the width that they cover.
fn is_busy(runs: &[Vec<Point>]) -> bool {
    let steps =
        || runs.iter().flat_map(|run| run.windows(2)).filter_map(|pair| pair.first().zip(pair.last()));
    let length: f64 = steps().map(|(from, to)| (to.0 - from.0).abs() + (to.1 - from.1).abs()).sum();
    let width: f64 = steps().map(|(from, to)| (to.0 - from.0).abs()).sum();
    length > BUSY_LENGTH_PER_WIDTH * width
}

/// Inserts the corners of the zero-order hold: each value extends to the x of the next sample.
fn corners(samples: impl Iterator<Item = Option<Point>>) -> impl Iterator<Item = Option<Point>> {
    let mut held: Option<f64> = None;
    samples.flat_map(move |sample| {
        let corner = sample.zip(held).map(|((x, _), held_y)| Some((x, held_y)));
        held = sample.map(|(_, y)| y);
        corner.into_iter().chain([sample])
    })
}

fn markers(samples: &[(f64, f64)], slot: Slot, projection: &Projection) -> Drawing {
    let mut path = Path::default();
    let mut taken = BTreeSet::new();
    let frame = projection.frame.grown(EDGE_PX);
    for (x, y) in samples.iter().filter_map(|&sample| projection.point(sample)) {
        let (x_px, y_px) = projection.point_px((x, y));
        if !frame.contains((x_px, y_px)) {
            continue;
        }
        let cell = |px: f64| ((px / MARKER_CELL_PX).round() + 0.0).to_bits();
        if taken.insert((cell(x_px), cell(y_px))) {
            slot.add_marker(&mut path, x_px, y_px);
        }
    }
    Drawing::Markers(path)
}

/// Draws strokes from the lower to the upper ends, cut at the frame, with a cap at each end within it.
fn errors(bars: &[ErrorBar], projection: &Projection) -> Drawing {
    let mut path = Path::default();
    let frame = projection.frame.grown(EDGE_PX);
    for ends in bars.iter().filter_map(|bar| bar.ends(projection.x.scale, projection.y.scale)) {
        let ends = ends.map(|end| projection.point_px(end));
        clipped(&ends, &frame).into_iter().for_each(|stroke| path.polyline(stroke));
        for (x, y) in ends.into_iter().filter(|end| frame.contains(*end)) {
            path.error_cap(x, y);
        }
    }
    Drawing::Errors(path)
}

/// Draws one closed outline per block of adjacent bins.
fn bars(bins: &[Bin], projection: &Projection) -> Drawing {
    let floor = projection.y.scale.forward(0.0).unwrap_or(projection.y.low);
    let mut path = Path::default();
    for run in decimate(bar_outline(bins, projection, floor), projection.column()) {
        path.polyline(run.into_iter().map(|point| projection.frame.nearest(projection.point_px(point))));
        path.close();
    }
    Drawing::Bars(path)
}

/// Returns the outline of the bars, with a gap (`None`) between blocks.
fn bar_outline(bins: &[Bin], projection: &Projection, floor: f64) -> Vec<Option<Point>> {
    let mut outline = Vec::new();
    let mut reached: Option<f64> = None;
    let drawable = |bin: &Bin| bin.edges(projection.x.scale).zip(projection.y.scale.forward(bin.height));
    for ((left, right), height) in bins.iter().filter_map(drawable) {
        // Edges computed two ways may differ by rounding: a hundredth of a pixel is no gap.
        let touches = reached.is_some_and(|end| (left - end).abs() < 0.01 * projection.column());
        if !touches {
            if let Some(end) = reached {
                outline.extend([Some((end, floor)), None]);
            }
            outline.push(Some((left, floor)));
        }
        outline.extend([Some((left, height)), Some((right, height))]);
        reached = Some(right);
    }
    if let Some(end) = reached {
        outline.push(Some((end, floor)));
    }
    outline
}
