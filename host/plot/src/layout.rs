//! Layout: computes rectangles, ticks and label positions from the model.
//!
//! Three passes, each based on the previous one: ranges and y ticks ([`drafts`]), then gutters, which determine the width of each
//! column ([`columns`]; panels of a column have the same gutters, so that their x axes are aligned), then rows from top to bottom
//! ([`place_row`]).

use super::axis::{Axis, Domain, Extent, Fit};
use super::labels::{
    HEADING_ROW_PX, Heading, LEGEND_ROW_PX, Legend, MARK_ROW_PX, MarkLabel, side_gutter_px, top_labels,
};
use super::mark::Direction;
use super::projection::{Projection, Rect};
use super::series::Shape;
use super::text;
use super::theme::font_px;
use super::ticks::{Spacing, Ticks};
use super::{Figure, Panel};

pub(super) const MARGIN_PX: f64 = 24.0;
pub(super) const TITLE_LINE_PX: f64 = 24.0;
pub(super) const SUBTITLE_LINE_PX: f64 = 18.0;
/// Distance from the frame to the tick labels at its left.
pub(super) const FRAME_TO_Y_LABEL_PX: f64 = 8.0;
/// Distance from the frame down to the baseline of the tick labels below it.
pub(super) const FRAME_TO_X_LABEL_PX: f64 = 17.0;
/// Distance from the frame down to the baseline of the x axis' name.
pub(super) const FRAME_TO_X_NAME_PX: f64 = 35.0;

const COLUMN_GAP_PX: f64 = 36.0;
const ROW_GAP_PX: f64 = 14.0;
const HEADING_TO_FRAME_PX: f64 = 5.0;
const DESCENDER_PX: f64 = 5.0;
const Y_LABEL_PITCH_PX: f64 = 21.0;
const X_LABEL_GAP_PX: f64 = 26.0;
/// Minimum width of a plotting area between gutters.
const LEAST_FRAME_WIDTH_PX: f64 = 40.0;

/// Arranged figure.
#[derive(Debug)]
pub(super) struct Layout<'a> {
    pub(super) height: f64,
    pub(super) title: Vec<String>,
    pub(super) subtitle: Vec<String>,
    pub(super) cells: Vec<Cell<'a>>,
}

/// Arranged panel.
#[derive(Debug)]
pub(super) struct Cell<'a> {
    pub(super) draft: Draft<'a>,
    pub(super) head: Head<'a>,
    pub(super) projection: Projection,
    /// Left end of the heading, and of a legend in rows of its own.
    pub(super) left: f64,
    /// Top of the heading row.
    pub(super) top: f64,
}

/// Arranges the whole figure.
pub(super) fn arrange(figure: &Figure) -> Layout<'_> {
    let inner_px = figure.width_px - 2.0 * MARGIN_PX;
    // Semi-bold is about a tenth wider than regular.
    let title = text::wrap(&figure.title, inner_px / 1.1, font_px::TITLE);
    let mut subtitle = text::wrap(&figure.subtitle, inner_px, font_px::SUBTITLE);
    subtitle.extend(text::wrap(&figure.note(), inner_px, font_px::SUBTITLE));
    let mut y = MARGIN_PX + TITLE_LINE_PX * title.len() as f64 + SUBTITLE_LINE_PX * subtitle.len() as f64;

    let mut drafts = drafts(figure);
    let columns = columns(figure, &drafts);
    let mut cells = Vec::with_capacity(drafts.len());
    while !drafts.is_empty() {
        let row = drafts.drain(..columns.len().min(drafts.len())).collect();
        y = place_row(row, &columns, figure.panel_height_px, y + ROW_GAP_PX, &mut cells);
    }
    Layout { height: y + MARGIN_PX, title, subtitle, cells }
}

/// Panel with its ranges, not placed yet.
#[derive(Debug)]
pub(super) struct Draft<'a> {
    pub(super) panel: &'a Panel,
    pub(super) x_axis: &'a Axis,
    x: Domain,
    y: Domain,
    pub(super) y_ticks: Ticks,
    /// True if the x tick labels and the x axis' name are under this panel.
    pub(super) has_x_labels: bool,
    /// True if any sample is visible.
    pub(super) has_data: bool,
}

fn drafts<'a>(figure: &'a Figure) -> Vec<Draft<'a>> {
    let shared_x = x_domain(&figure.shared_x, figure.panels.iter().filter(|panel| panel.own_x.is_none()));
    let draft = |(index, panel): (usize, &'a Panel)| {
        let (x_axis, x) = match &panel.own_x {
            Some(own) => (own, x_domain(own, [panel])),
            None => (&figure.shared_x, shared_x),
        };
        Draft::new(panel, x_axis, x, figure.panel_height_px, has_x_labels(figure, index))
    };
    figure.panels.iter().enumerate().map(draft).collect()
}

/// Returns true if panel `index` has x labels: it has its own axis, or is the last of its column that
/// shares the figure's.
fn has_x_labels(figure: &Figure, index: usize) -> bool {
    let mut from_here_down = figure.panels.iter().skip(index).step_by(figure.columns);
    let is_shared = from_here_down.next().is_some_and(|panel| panel.own_x.is_none());
    !is_shared || from_here_down.all(|panel| panel.own_x.is_some())
}

/// Returns the x range that covers the series and marks of `panels`.
fn x_domain<'a>(axis: &Axis, panels: impl IntoIterator<Item = &'a Panel>) -> Domain {
    let mut extent = Extent::EMPTY;
    let mut fit = Fit::Tight;
    for panel in panels {
        for series in &panel.series {
            extent = extent.with(series.extent_x(axis.scale, panel.y.scale));
            if matches!(series.shape, Shape::Points(_)) {
                fit = Fit::Padded;
            }
        }
        for mark in panel.marks.iter().filter(|mark| mark.direction == Direction::X) {
            mark.include_in(&mut extent, axis.scale);
        }
    }
    axis.domain(extent, fit)
}

impl<'a> Draft<'a> {
    fn new(panel: &'a Panel, x_axis: &'a Axis, x: Domain, height_px: f64, has_x_labels: bool) -> Self {
        let extents = panel.series.iter().map(|series| series.extent_y(&x, panel.y.scale));
        let mut extent = extents.fold(Extent::EMPTY, Extent::with);
        let has_data = !extent.is_empty();
        for mark in panel.marks.iter().filter(|mark| mark.direction == Direction::Y) {
            mark.include_in(&mut extent, panel.y.scale);
        }
        let has_bars = panel.series.iter().any(|series| matches!(series.shape, Shape::Histogram(_)));
        let y = panel.y.domain(extent, if has_bars { Fit::OnZero } else { Fit::Padded });
        // Numbers at an axis without data would be misleading.
        let y_ticks = match extent.is_empty() && panel.y.fixed.is_none() {
            true => Ticks::default(),
            false => Ticks::fit(&y, height_px, Spacing::Vertical { pitch_px: Y_LABEL_PITCH_PX }),
        };
        Self { panel, x_axis, x, y, y_ticks, has_x_labels, has_data }
    }

    fn y_label_width_px(&self) -> f64 {
        self.y_ticks.major.iter().map(|tick| text::width_px(&tick.label, font_px::TICK)).fold(0.0, f64::max)
    }
}

/// Horizontal position of a column: its left edge, and its plotting area between the gutters.
#[derive(Debug, Clone, Copy)]
struct Column {
    left: f64,
    frame_left: f64,
    frame_width: f64,
}

fn columns(figure: &Figure, drafts: &[Draft<'_>]) -> Vec<Column> {
    let count = figure.columns.min(drafts.len());
    let all_px = figure.width_px - 2.0 * MARGIN_PX + COLUMN_GAP_PX;
    let pitch_px = all_px / count.max(1) as f64;
    let column = |index: usize| {
        let mine = || drafts.iter().skip(index).step_by(count);
        let left_px = mine().map(Draft::y_label_width_px).fold(0.0, f64::max) + FRAME_TO_Y_LABEL_PX;
        let right_px = mine().map(|draft| side_gutter_px(&draft.panel.marks, &draft.y)).fold(0.0, f64::max);
        let left = MARGIN_PX + pitch_px * index as f64;
        let frame_width = (pitch_px - COLUMN_GAP_PX - left_px - right_px).max(LEAST_FRAME_WIDTH_PX);
        Column { left, frame_left: left + left_px, frame_width }
    };
    (0..count).map(column).collect()
}

/// Labels above a panel, and its x ticks: the parts that depend on the panel's column and not on its row.
#[derive(Debug)]
pub(super) struct Head<'a> {
    pub(super) x_ticks: Ticks,
    pub(super) heading: Heading,
    pub(super) legend: Legend<'a>,
    pub(super) top_labels: Vec<MarkLabel>,
    height_px: f64,
}

impl<'a> Head<'a> {
    fn new(draft: &Draft<'a>, column: &Column) -> Self {
        let Column { left, frame_left, frame_width } = *column;
        let right = frame_left + frame_width;
        let spacing = Spacing::Horizontal { gap_px: X_LABEL_GAP_PX, font_px: font_px::TICK };
        let heading = Heading::new(draft.panel, draft.y_ticks.exponent, right - left);
        let legend = Legend::new(draft.panel, &draft.x, &heading, left, right);
        let top_labels = top_labels(&draft.panel.marks, &draft.x, frame_left, right);
        let mark_rows = top_labels.iter().map(|label| label.row + 1).max().unwrap_or(0);
        let height_px = HEADING_ROW_PX
            + LEGEND_ROW_PX * legend.own_rows as f64
            + MARK_ROW_PX * mark_rows as f64
            + HEADING_TO_FRAME_PX;
        let x_ticks = match draft.x_axis.levels.as_slice() {
            [] => Ticks::fit(&draft.x, frame_width, spacing),
            levels => Ticks::at(&draft.x, levels),
        };
        Self { x_ticks, heading, legend, top_labels, height_px }
    }
}

/// Places one row of panels below `top`, with aligned headings and aligned frames; returns the bottom of the row.
fn place_row<'a>(
    row: Vec<Draft<'a>>,
    columns: &[Column],
    height_px: f64,
    top: f64,
    cells: &mut Vec<Cell<'a>>,
) -> f64 {
    // If one panel of a row has x labels, all panels of the row have them.
    let has_x_labels = row.iter().any(|draft| draft.has_x_labels);
    let foot_px = if has_x_labels { row.iter().map(Draft::foot_px).fold(0.0, f64::max) } else { 0.0 };
    let heads: Vec<Head<'a>> =
        row.iter().zip(columns).map(|(draft, column)| Head::new(draft, column)).collect();
    let frame_top = top + heads.iter().map(|head| head.height_px).fold(0.0, f64::max);
    for ((draft, head), &Column { left, frame_left, frame_width }) in row.into_iter().zip(heads).zip(columns)
    {
        let frame = Rect { left: frame_left, top: frame_top, width: frame_width, height: height_px };
        let projection = Projection { x: draft.x, y: draft.y, frame };
        cells.push(Cell { draft: Draft { has_x_labels, ..draft }, head, projection, left, top });
    }
    frame_top + height_px + foot_px
}

impl Draft<'_> {
    /// Returns the height of x tick labels and the axis' name below the frame.
    fn foot_px(&self) -> f64 {
        let is_nameless = self.x_axis.label.is_empty() && self.x_axis.unit.is_empty();
        DESCENDER_PX + if is_nameless { FRAME_TO_X_LABEL_PX } else { FRAME_TO_X_NAME_PX }
    }
}
