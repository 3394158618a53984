//! Labels outside the plotting area: headings, legends, names of marks.
//!
//! No label covers data. The y axis' name is above its panel with the legend beside it (or below, if they do not fit in one row);
//! names of horizontal marks are in a gutter at the right, names of vertical marks in rows above the plotting area, moved apart
//! where they would overlap.

use super::Panel;
use super::axis::{Domain, Extent};
use super::mark::{Direction, Mark};
use super::projection::Projection;
use super::series::{Series, Shape};
use super::text;
use super::theme::font_px;

/// Height of the heading row.
pub(super) const HEADING_ROW_PX: f64 = 20.0;
/// Height of a legend row of its own.
pub(super) const LEGEND_ROW_PX: f64 = 18.0;
/// Height of a row of names of vertical marks.
pub(super) const MARK_ROW_PX: f64 = 15.0;

/// Length of the line sample in a legend.
pub(super) const SWATCH_PX: f64 = 24.0;
/// Length of the marker or bar sample in a legend.
const SHORT_SWATCH_PX: f64 = 10.0;
/// Distance from the sample in a legend to its text.
const SWATCH_TO_TEXT_PX: f64 = 6.0;
const LEGEND_GAP_PX: f64 = 18.0;
/// Maximum length of a text in a legend; longer texts end in an ellipsis.
const LEGEND_TEXT_LIMIT_PX: f64 = 260.0;

/// Distance from the plotting area to the names of horizontal marks: space for the leader line.
pub(super) const SIDE_LABEL_GAP_PX: f64 = 12.0;
/// Maximum length of the name of a horizontal mark.
const SIDE_LABEL_LIMIT_PX: f64 = 150.0;
const SIDE_LABEL_PITCH_PX: f64 = 14.0;
/// Distance from the pole of a vertical mark to its name.
const FLAG_GAP_PX: f64 = 4.0;
/// Largest overhang of the name of a vertical mark beyond the frame's right end: within margin and column gap.
const FLAG_OVERHANG_PX: f64 = 20.0;

/// Distance from the middle of lower-case letters to the baseline, as a fraction of the font size.
const BASELINE_BELOW_MIDDLE_EM: f64 = 0.34;

/// Panel title with the y axis' name and unit; the first part in semi-bold.
#[derive(Debug)]
pub(super) struct Heading {
    pub(super) strong: String,
    pub(super) light: String,
}

impl Heading {
    /// Composes the heading of `panel`, shortened to `limit_px`; `exponent` is the power of ten that the y tick labels leave out.
    pub(super) fn new(panel: &Panel, exponent: i32, limit_px: f64) -> Self {
        let (strong, light) = match panel.title.is_empty() {
            true => (&panel.y.label, panel.y.unit_label(exponent)),
            false => (&panel.title, panel.y.name(exponent)),
        };
        let strong = text::shorten(strong, limit_px, font_px::HEADING);
        let room_px = (limit_px - text::width_px(&strong, font_px::HEADING)).max(0.0);
        Self { light: text::shorten(&light, room_px, font_px::HEADING), strong }
    }

    fn width_px(&self) -> f64 {
        // Semi-bold is about a tenth wider than regular, and a space separates the two parts.
        1.1 * text::width_px(&self.strong, font_px::HEADING)
            + text::width_px(&self.light, font_px::HEADING)
            + 0.5 * font_px::HEADING
    }
}

/// Legend entry, placed relative to the top left corner of its legend.
#[derive(Debug)]
pub(super) struct LegendEntry<'a> {
    pub(super) series: &'a Series,
    /// Index of the series in its panel.
    pub(super) index: usize,
    pub(super) text: String,
    /// Left end of the sample.
    pub(super) x: f64,
    pub(super) row: usize,
    width_px: f64,
}

impl LegendEntry<'_> {
    pub(super) fn swatch_px(&self) -> f64 {
        match self.series.shape {
            Shape::Line(_) | Shape::Steps(_) => SWATCH_PX,
            Shape::Points(_) | Shape::Histogram(_) | Shape::Errors(_) => SHORT_SWATCH_PX,
        }
    }

    pub(super) fn text_x(&self) -> f64 {
        self.x + self.swatch_px() + SWATCH_TO_TEXT_PX
    }
}

/// Legend of a panel: beside the heading, ending at the frame's right, or in rows of its own below.
#[derive(Debug)]
pub(super) struct Legend<'a> {
    pub(super) entries: Vec<LegendEntry<'a>>,
    /// Number of rows of the legend below the heading; 0: beside the heading.
    pub(super) own_rows: usize,
}

impl<'a> Legend<'a> {
    /// Places the entries between `left` and `right`, with `heading` at the start of the row.
    /// Series without a label have no entry.
    pub(super) fn new(panel: &'a Panel, x: &Domain, heading: &Heading, left: f64, right: f64) -> Self {
        let labelled = panel.series.iter().enumerate().filter(|(_, series)| !series.label.is_empty());
        let entry = |(index, series): (usize, &'a Series)| {
            LegendEntry::new(series, index, &series.extent_y(x, panel.y.scale))
        };
        let mut entries: Vec<LegendEntry<'a>> = labelled.map(entry).collect();
        let all_px: f64 =
            entries.iter().map(|entry| entry.width_px + LEGEND_GAP_PX).sum::<f64>() - LEGEND_GAP_PX;
        if entries.is_empty() || left + heading.width_px() + LEGEND_GAP_PX + all_px <= right {
            flow(&mut entries, right - all_px, f64::INFINITY);
            return Self { entries, own_rows: 0 };
        }
        let own_rows = flow(&mut entries, left, right);
        Self { entries, own_rows }
    }
}

impl<'a> LegendEntry<'a> {
    fn new(series: &'a Series, index: usize, extent_y: &Extent) -> Self {
        let mut text = text::shorten(&series.label, LEGEND_TEXT_LIMIT_PX, font_px::LABEL);
        if extent_y.is_empty() {
            text.push_str(" (no data)");
        }
        let mut entry = Self { series, index, text, x: 0.0, row: 0, width_px: 0.0 };
        entry.width_px = entry.text_x() + text::width_px(&entry.text, font_px::LABEL);
        entry
    }
}

/// Places entries from `left` on, and starts a new row before an entry that would extend beyond `right`; returns the number of rows.
fn flow(entries: &mut [LegendEntry<'_>], left: f64, right: f64) -> usize {
    let (mut x, mut row) = (left, 0);
    for entry in entries {
        if x > left && x + entry.width_px > right {
            (x, row) = (left, row + 1);
        }
        (entry.x, entry.row) = (x, row);
        x += entry.width_px + LEGEND_GAP_PX;
    }
    row + 1
}

/// Name of a mark.
#[derive(Debug)]
pub(super) struct MarkLabel {
    pub(super) text: String,
    /// Point where the mark meets the frame, in pixels along the mark's axis.
    pub(super) anchor: f64,
    /// Centre of the name along the mark's axis, pixels.
    pub(super) middle: f64,
    /// Half the length of the name of a vertical mark, pixels.
    half_px: f64,
    /// Row of the name of a vertical mark above the frame; 0: nearest.
    pub(super) row: usize,
}

impl MarkLabel {
    /// Returns the left end of a name of a vertical mark.
    pub(super) fn start(&self) -> f64 {
        self.middle - self.half_px
    }

    /// Returns the right end of a name of a vertical mark.
    fn end(&self) -> f64 {
        self.middle + self.half_px
    }
}

/// Returns the baseline of text with its vertical centre at `middle`.
pub(super) fn baseline(middle: f64, font_px: f64) -> f64 {
    middle + BASELINE_BELOW_MIDDLE_EM * font_px
}

/// Returns the width of the gutter for the names of horizontal marks at the right of the frame.
pub(super) fn side_gutter_px(marks: &[Mark], y: &Domain) -> f64 {
    visible_marks(marks, Direction::Y, y)
        .map(|(label, _)| text::width_px(&side_text(label), font_px::LABEL) + SIDE_LABEL_GAP_PX)
        .fold(0.0, f64::max)
}

/// Places the names of horizontal marks, top to bottom, without overlap.
pub(super) fn side_labels(marks: &[Mark], projection: &Projection) -> Vec<MarkLabel> {
    let mut labels: Vec<MarkLabel> = visible_marks(marks, Direction::Y, &projection.y)
        .map(|(label, at)| (side_text(label), projection.y_px(at)))
        .map(|(text, anchor)| MarkLabel { text, anchor, middle: anchor, half_px: 0.0, row: 0 })
        .collect();
    labels.sort_by(|one, other| one.anchor.total_cmp(&other.anchor));
    spread(&mut labels, projection.frame.top, projection.frame.bottom());
    labels
}

/// Places the names of vertical marks as flags to the right of their marks, or to the left at the end of the picture. No pole
/// crosses a name: rows are filled with right flags from the right, so that flags in lower rows begin further right, then with left
/// flags from the left.
pub(super) fn top_labels(marks: &[Mark], x: &Domain, left: f64, right: f64) -> Vec<MarkLabel> {
    let mut named: Vec<(f64, &str)> = visible_marks(marks, Direction::X, x)
        .map(|(label, at)| (left + (right - left) * x.fraction(at), label))
        .collect();
    named.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let (mut flags, mut left_flags) = (Vec::new(), Vec::new());
    // A right flag ends before the pole of the first left flag, which is in a higher row.
    let mut limit = right + FLAG_OVERHANG_PX;
    for (anchor, label) in named {
        let text = text::shorten(label, right - left, font_px::LABEL);
        let width_px = text::width_px(&text, font_px::LABEL);
        let has_no_room_at_left = anchor - FLAG_GAP_PX - width_px < left;
        let fits = anchor + FLAG_GAP_PX + width_px <= limit || has_no_room_at_left;
        let start = if fits { anchor + FLAG_GAP_PX } else { anchor - FLAG_GAP_PX - width_px };
        let flag =
            MarkLabel { text, anchor, middle: start + 0.5 * width_px, half_px: 0.5 * width_px, row: 0 };
        if fits {
            flags.push(flag);
        } else {
            limit = anchor - FLAG_GAP_PX;
            left_flags.push(flag);
        }
    }
    let mut row_starts: Vec<f64> = Vec::new();
    for flag in &mut flags {
        let (start, end) = (flag.anchor, flag.end() + FLAG_GAP_PX);
        flag.row = row_starts.iter().position(|&row_start| end <= row_start).unwrap_or(row_starts.len());
        match row_starts.get_mut(flag.row) {
            Some(row_start) => *row_start = start,
            None => row_starts.push(start),
        }
    }
    for mut flag in left_flags.into_iter().rev() {
        // Above every flag that it would overlap, or that has a pole that would cross it.
        let meets = |other: &&MarkLabel| {
            other.anchor.max(other.end()) + FLAG_GAP_PX > flag.start()
                && other.start().min(other.anchor) < flag.anchor
        };
        flag.row = flags.iter().filter(meets).map(|other| other.row + 1).max().unwrap_or(0);
        flags.push(flag);
    }
    flags
}

fn side_text(label: &str) -> String {
    text::shorten(label, SIDE_LABEL_LIMIT_PX, font_px::LABEL)
}

/// Returns the labels of visible marks on one axis, with their coordinates.
fn visible_marks<'a>(
    marks: &'a [Mark],
    direction: Direction,
    domain: &Domain,
) -> impl Iterator<Item = (&'a str, f64)> {
    marks
        .iter()
        .filter(move |mark| mark.direction == direction && !mark.label.is_empty())
        .filter_map(|mark| mark.visible(domain).map(|at| (mark.label.as_str(), at)))
}

/// Moves sorted labels apart to the pitch: first down from `top`, then up from `bottom`.
fn spread(labels: &mut [MarkLabel], top: f64, bottom: f64) {
    let mut least = top;
    for label in labels.iter_mut() {
        label.middle = label.middle.max(least);
        least = label.middle + SIDE_LABEL_PITCH_PX;
    }
    let mut most = bottom;
    for label in labels.iter_mut().rev() {
        label.middle = label.middle.min(most);
        most = label.middle - SIDE_LABEL_PITCH_PX;
    }
}
