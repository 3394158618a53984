//! Drawings of series: lines, markers, bars and error bars as paths within the plotting area.

use std::collections::BTreeSet;

use super::clip::clipped;
use super::cover::{Course, MAX_COVERS};
use super::decimate::{Point, decimate};
use super::path::Path;
use super::projection::Projection;
use super::series::{Bin, ErrorBar, Series, Shape};
use super::theme::Slot;

/// Ratio of length to width above which a line oscillates so densely that dashes would hide its peaks.
const BUSY_LENGTH_PER_WIDTH: f64 = 4.0;

/// Side of the square cells in each of which only one marker is drawn.
const MARKER_CELL_PX: f64 = 1.0;

/// Tolerance for a point on the edge of the frame: half of the rounding of coordinates.
const EDGE_PX: f64 = 0.05;

/// Drawing of one series.
#[derive(Debug)]
pub(super) enum Drawing {
    /// A line, and `dots` for isolated samples between gaps, which dashes would hide. `busy`: the line oscillates so densely that
    /// dashes would hide parts of it. `covers`: number of later lines that cover it.
    Line { path: Path, dots: Path, busy: bool, course: Course, covers: usize },
    /// Filled marker outlines.
    Markers(Path),
    /// Filled outlines of bars.
    Bars(Path),
    /// Vertical strokes with caps.
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
    let visible = |run: Vec<Point>| {
        let run_px: Vec<Point> = run.into_iter().map(|point| projection.point_px(point)).collect();
        clipped(&run_px, &projection.frame.grown(EDGE_PX))
    };
    let runs: Vec<Vec<Point>> =
        decimate(samples, projection.column()).into_iter().flat_map(visible).collect();
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

/// Returns true if the line is much longer than the width that it covers.
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

/// Draws strokes from the lower to the upper ends, clipped to the frame, with a cap at each end within the frame.
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
        // Equal edges may differ by rounding errors: a hundredth of a pixel is not a gap.
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

/// Counts, for each line of a panel, the later lines that cover it.
pub(super) fn count_covers(drawings: &mut [Option<Drawing>]) {
    for lower in 0..drawings.len() {
        let (before, after) = drawings.split_at_mut(lower + 1);
        let Some(Some(Drawing::Line { course, covers, .. })) = before.last_mut() else { continue };
        let over = after.iter().flatten().filter(|upper| match upper {
            Drawing::Line { course: upper, .. } => course.is_under(upper),
            _ => false,
        });
        *covers = over.count().min(MAX_COVERS);
    }
}
