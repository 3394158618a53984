//! SVG document of an arranged figure.
//!
//! Within a panel, from back to front: grid, reference lines, data, axis. The document has no ids and its styles apply to `.plot`
//! only, so that a page can contain several pictures. It has one `<svg>` element and no `<clipPath>`, which converters to PDF draw
//! incorrectly; data are clipped to the frame before they are written (`clip`).

use super::Figure;
use super::axis::{Domain, Scale};
use super::drawing::{Drawing, count_covers, draw};
use super::labels::{
    HEADING_ROW_PX, LEGEND_ROW_PX, Legend, LegendEntry, MARK_ROW_PX, SIDE_LABEL_GAP_PX, baseline, side_labels,
};
use super::layout::{
    Cell, FRAME_TO_X_LABEL_PX, FRAME_TO_X_NAME_PX, FRAME_TO_Y_LABEL_PX, Layout, MARGIN_PX, SUBTITLE_LINE_PX,
    TITLE_LINE_PX,
};
use super::mark::{Direction, MarkLook};
use super::path::Path;
use super::projection::Projection;
use super::series::{Series, Shape};
use super::text::{self, escape, px};
use super::theme::{Slot, font_px, style_sheet};

/// Half the size of the cross of a fault, and distance of the cross's centre from the top of the frame.
const FAULT_CROSS_PX: f64 = 4.5;
const FAULT_CROSS_DEPTH_PX: f64 = 8.0;

/// Height of the bar over intervals in which a limit acted, and minimum drawn width of an interval.
const LIMITED_BAR_PX: f64 = 5.0;
const LEAST_STRETCH_PX: f64 = 1.5;

const MAJOR_TICK_PX: f64 = 5.0;
const MINOR_TICK_PX: f64 = 3.0;

/// Minimum length of a decade for which minor grid lines are drawn.
const MINOR_GRID_DECADE_PX: f64 = 60.0;

/// Writes the figure as an SVG document.
pub(super) fn document(figure: &Figure, layout: &Layout<'_>) -> String {
    let mut writer = Writer::default();
    let (width, height) = (px(figure.width_px), px(layout.height));
    let (shown_width, shown_height) = (px(figure.scale * figure.width_px), px(figure.scale * layout.height));
    writer.raw(&format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" role=\"img\" width=\"{shown_width}\" \
         height=\"{shown_height}\" viewBox=\"0 0 {width} {height}\">\n"
    ));
    writer.element("title", &figure.title);
    writer.element("desc", &description(figure, layout));
    writer.raw(&format!("<style>\n{}</style>\n", style_sheet(figure.paper)));
    writer.raw(&format!("<rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>\n"));
    writer.watermark(&figure.watermark, figure.width_px, layout.height);
    let mut y = MARGIN_PX;
    for line in &layout.title {
        writer.text("title", MARGIN_PX, y + 0.7 * TITLE_LINE_PX, line);
        y += TITLE_LINE_PX;
    }
    for line in &layout.subtitle {
        writer.text("subtitle muted", MARGIN_PX, y + 0.7 * SUBTITLE_LINE_PX, line);
        y += SUBTITLE_LINE_PX;
    }
    for cell in &layout.cells {
        writer.cell(cell);
    }
    writer.raw("</svg>\n");
    writer.out
}

/// Describes the content of the picture in words, for screen readers.
fn description(figure: &Figure, layout: &Layout<'_>) -> String {
    let mut description = format!("{} {}", figure.subtitle, figure.note()).trim().to_owned();
    for cell in &layout.cells {
        let panel = cell.draft.panel;
        let sentence = format!(
            " {}{} against {}:",
            if panel.title.is_empty() { String::new() } else { format!("{}: ", panel.title) },
            panel.y.name(0),
            cell.draft.x_axis.name(0),
        );
        description.push_str(&sentence);
        let value = |coordinate| text::significant(panel.y.scale.backward(coordinate));
        let clause = |series: &Series| {
            let extent = series.extent_y(&cell.projection.x, panel.y.scale);
            let label = if series.label.is_empty() { String::new() } else { format!("{}, ", series.label) };
            let kind = if matches!(series.shape, Shape::Histogram(_)) { "bins" } else { "samples" };
            let range = match extent.is_empty() {
                true => "none to show".to_owned(),
                false => format!("{} to {}", value(extent.low), value(extent.high)),
            };
            format!(" {label}{} {kind}, {range}", series.given)
        };
        let clauses: Vec<String> = panel.series.iter().map(clause).collect();
        description.push_str(if clauses.is_empty() { " no data" } else { "" });
        description.push_str(&clauses.join(";"));
        description.push('.');
    }
    description.trim().to_owned()
}

/// Document under construction.
#[derive(Default)]
struct Writer {
    out: String,
}

impl Writer {
    fn raw(&mut self, markup: &str) {
        self.out.push_str(markup);
    }

    fn element(&mut self, name: &str, content: &str) {
        self.raw(&format!("<{name}>{}</{name}>\n", escape(content)));
    }

    /// Writes a line of text with its baseline at `y`; `x` is the start, the middle or the end of the text, depending on the class.
    fn text(&mut self, class: &str, x: f64, y: f64, content: &str) {
        self.raw(&format!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\">{}</text>\n",
            px(x),
            px(y),
            escape(content)
        ));
    }

    /// Writes a text across the middle of the picture, over most of its width; nothing for an empty text.
    fn watermark(&mut self, content: &str, width: f64, height: f64) {
        /// Approximate width of a character in units of the font size.
        const CHARACTER: f64 = 0.6;
        /// Fraction of the picture's width that the text takes.
        const SHARE: f64 = 0.85;
        if content.is_empty() {
            return;
        }
        let size = SHARE * width / (CHARACTER * content.chars().count() as f64);
        self.raw(&format!(
            "<text class=\"watermark middle\" style=\"font-size:{}px\" x=\"{}\" y=\"{}\">{}</text>\n",
            px(size),
            px(0.5 * width),
            px(0.5 * height + 0.35 * size),
            escape(content),
        ));
    }

    fn path(&mut self, class: &str, path: &Path) {
        self.dashed_path(class, "", path);
    }

    fn dashed_path(&mut self, class: &str, dash: &str, path: &Path) {
        if path.is_empty() {
            return;
        }
        let dash = if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dash}\"") };
        self.raw(&format!("<path class=\"{class}\"{dash} d=\"{}\"/>\n", path.data));
    }

    fn cell(&mut self, cell: &Cell<'_>) {
        let series = cell.draft.panel.series.iter().enumerate();
        let mut drawings: Vec<Option<Drawing>> =
            series.map(|(index, series)| draw(series, series.look(index), &cell.projection)).collect();
        count_covers(&mut drawings);
        self.raw("<g>\n");
        self.grid(cell);
        self.reference_lines(cell);
        self.limited(cell);
        self.data(cell, &drawings);
        self.faults(cell);
        if cell.draft.has_x_labels {
            self.x_axis(cell);
        }
        self.y_labels(cell);
        self.head(cell, &drawings);
        self.mark_labels(cell);
        self.raw("</g>\n");
    }

    fn reference_lines(&mut self, cell: &Cell<'_>) {
        let projection @ Projection { x, y, frame } = &cell.projection;
        let mut path = Path::default();
        for mark in cell.draft.panel.marks.iter().filter(|mark| mark.look == MarkLook::Reference) {
            let line = match mark.direction {
                Direction::X => mark.visible(x).map(|at| frame.upright(projection.x_px(at))),
                Direction::Y => mark.visible(y).map(|at| frame.level(projection.y_px(at))),
            };
            line.into_iter().for_each(|line| path.polyline(line));
        }
        self.path("reference", &path);
    }

    /// Draws a line with a cross for each fault, over the data.
    fn faults(&mut self, cell: &Cell<'_>) {
        let projection @ Projection { x, frame, .. } = &cell.projection;
        let mut path = Path::default();
        let faults = cell.draft.panel.marks.iter().filter(|mark| mark.look == MarkLook::Fault);
        for at in faults.filter_map(|mark| mark.visible(x)) {
            let (x, y) = (projection.x_px(at), frame.top + FAULT_CROSS_DEPTH_PX);
            path.polyline(frame.upright(x));
            for sign in [-1.0, 1.0] {
                let (dx, dy) = (FAULT_CROSS_PX, sign * FAULT_CROSS_PX);
                path.polyline([(x - dx, y - dy), (x + dx, y + dy)]);
            }
        }
        self.path("fault", &path);
    }

    /// Draws a bar along the foot over the intervals in which a limit acted.
    fn limited(&mut self, cell: &Cell<'_>) {
        let projection @ Projection { x, frame, .. } = &cell.projection;
        let mut path = Path::default();
        let mut reached = f64::NEG_INFINITY;
        for stretch in cell.draft.panel.limited.iter().flat_map(|spans| &spans.stretches) {
            let ends = stretch.map(|at| x.scale.forward(at).map(|at| projection.x_px(at)));
            let [Some(from), Some(to)] = ends else { continue };
            let to = to.max(from + LEAST_STRETCH_PX).min(frame.right());
            let from = from.max(frame.left).max(reached);
            if from < to {
                let (bottom, top) = (frame.bottom(), frame.bottom() - LIMITED_BAR_PX);
                path.outline([(from, bottom), (from, top), (to, top), (to, bottom)]);
                reached = to;
            }
        }
        self.path("limited", &path);
    }

    fn grid(&mut self, cell: &Cell<'_>) {
        let Projection { x, y, frame } = &cell.projection;
        let (mut minor, mut major, mut zero_line) = (Path::default(), Path::default(), Path::default());
        let (x_ticks, y_ticks) = (&cell.head.x_ticks, &cell.draft.y_ticks);
        let (upright, level) = (|at| frame.upright(frame.x_at(at)), |at| frame.level(frame.y_at(at)));
        if has_minor_grid(x, frame.width) {
            x_ticks.minor.iter().for_each(|&at| minor.polyline(upright(at)));
        }
        if has_minor_grid(y, frame.height) {
            y_ticks.minor.iter().for_each(|&at| minor.polyline(level(at)));
        }
        x_ticks.major.iter().for_each(|tick| major.polyline(upright(tick.position)));
        y_ticks.major.iter().for_each(|tick| major.polyline(level(tick.position)));
        if !cell.draft.has_x_labels {
            major.polyline(frame.level(frame.bottom()));
        }
        let zero = y.scale.forward(0.0).map(|zero| y.fraction(zero)).filter(|zero| (0.0..1.0).contains(zero));
        if let Some(zero) = zero
            && !y_ticks.major.is_empty()
        {
            zero_line.polyline(level(zero));
        }
        self.path("hair grid minor", &minor);
        self.path("hair grid", &major);
        self.path("hair axis", &zero_line);
    }

    fn data(&mut self, cell: &Cell<'_>, drawings: &[Option<Drawing>]) {
        let frame = &cell.projection.frame;
        if !cell.draft.has_data {
            let y = baseline(frame.y_at(0.5), font_px::LABEL);
            self.text("label muted middle", frame.x_at(0.5), y, "no data");
            return;
        }
        for (index, (series, drawing)) in cell.draft.panel.series.iter().zip(drawings).enumerate() {
            if let Some(drawing) = drawing {
                self.drawing(drawing, series.look(index));
            }
        }
    }

    fn drawing(&mut self, drawing: &Drawing, slot: Slot) {
        let (stroke, fill) = (slot.stroke_class(), slot.fill_class());
        match drawing {
            Drawing::Line { path, dots, busy, covers, .. } => {
                match (covers, busy, slot.dash()) {
                    (1.., ..) => self.path(&format!("line round {} {stroke}", under(*covers)), path),
                    (0, true, _) => self.path(&format!("line busy round {stroke}"), path),
                    (0, false, "") => self.path(&format!("line round {stroke}"), path),
                    (0, false, dash) => self.dashed_path(&format!("line {stroke}"), dash, path),
                }
                self.path(&format!("line round {stroke}"), dots);
            }
            Drawing::Markers(path) => self.path(&format!("points {fill}"), path),
            Drawing::Bars(path) => self.path(&format!("bars {fill} {stroke}"), path),
            Drawing::Errors(path) => self.path(&format!("errors {stroke}"), path),
        }
    }

    fn x_axis(&mut self, cell: &Cell<'_>) {
        let frame = &cell.projection.frame;
        let mut axis = Path::default();
        axis.polyline(frame.level(frame.bottom()));
        let major = cell.head.x_ticks.major.iter().map(|tick| (tick.position, MAJOR_TICK_PX));
        let minor = cell.head.x_ticks.minor.iter().map(|&position| (position, MINOR_TICK_PX));
        for (position, length) in major.chain(minor) {
            let x = frame.x_at(position);
            axis.polyline([(x, frame.bottom()), (x, frame.bottom() + length)]);
        }
        self.path("hair axis", &axis);
        for tick in &cell.head.x_ticks.major {
            let y = frame.bottom() + FRAME_TO_X_LABEL_PX;
            self.text("muted middle", frame.x_at(tick.position), y, &tick.label);
        }
        let name = cell.draft.x_axis.name(cell.head.x_ticks.exponent);
        if !name.is_empty() {
            self.text("label middle", frame.x_at(0.5), frame.bottom() + FRAME_TO_X_NAME_PX, &name);
        }
    }

    fn y_labels(&mut self, cell: &Cell<'_>) {
        let frame = &cell.projection.frame;
        for tick in &cell.draft.y_ticks.major {
            let y = baseline(frame.y_at(tick.position), font_px::TICK);
            self.text("muted end", frame.left - FRAME_TO_Y_LABEL_PX, y, &tick.label);
        }
    }

    /// Writes heading and legend.
    fn head(&mut self, cell: &Cell<'_>, drawings: &[Option<Drawing>]) {
        let y = baseline(cell.top + 0.5 * HEADING_ROW_PX, font_px::HEADING);
        let light = match cell.head.heading.light.is_empty() {
            true => String::new(),
            false => format!(" <tspan class=\"unit muted\">{}</tspan>", escape(&cell.head.heading.light)),
        };
        self.raw(&format!(
            "<text class=\"heading\" x=\"{}\" y=\"{}\">{}{light}</text>\n",
            px(cell.left),
            px(y),
            escape(&cell.head.heading.strong)
        ));
        let Legend { entries, own_rows } = &cell.head.legend;
        let first_row = match own_rows {
            0 => cell.top + 0.5 * HEADING_ROW_PX,
            _ => cell.top + HEADING_ROW_PX + 0.5 * LEGEND_ROW_PX,
        };
        for entry in entries {
            let drawing = drawings.get(entry.index).and_then(Option::as_ref);
            self.legend_entry(entry, drawing, first_row + LEGEND_ROW_PX * entry.row as f64);
        }
    }

    /// Writes one legend entry, with a sample of the series as drawn in this panel.
    fn legend_entry(&mut self, entry: &LegendEntry<'_>, drawing: Option<&Drawing>, middle: f64) {
        let (left, right) = (entry.x, entry.x + entry.swatch_px());
        let center = 0.5 * (left + right);
        let slot = entry.series.look(entry.index);
        let mut path = Path::default();
        match drawing {
            Some(Drawing::Markers(_)) => {
                slot.add_marker(&mut path, center, middle);
                self.drawing(&Drawing::Markers(path), slot);
            }
            Some(Drawing::Bars(_)) => {
                path.polygon(center, middle, &[(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)]);
                self.drawing(&Drawing::Bars(path), slot);
            }
            Some(Drawing::Errors(_)) => {
                path.polyline([(center, middle - 5.0), (center, middle + 5.0)]);
                path.error_cap(center, middle - 5.0);
                path.error_cap(center, middle + 5.0);
                self.drawing(&Drawing::Errors(path), slot);
            }
            Some(Drawing::Line { busy, covers, .. }) => {
                path.polyline([(left, middle), (right, middle)]);
                let dash = if *busy || *covers > 0 { "" } else { slot.dash() };
                let class = format!("line {} {}", under(*covers), slot.stroke_class()).replace("  ", " ");
                self.dashed_path(&class, dash, &path);
            }
            None => {}
        }
        self.text("label", entry.text_x(), baseline(middle, font_px::LABEL), &entry.text);
    }

    fn mark_labels(&mut self, cell: &Cell<'_>) {
        let frame = &cell.projection.frame;
        let mut leaders = Path::default();
        for label in side_labels(&cell.draft.panel.marks, &cell.projection) {
            let x = frame.right() + SIDE_LABEL_GAP_PX;
            leaders.polyline([(frame.right(), label.anchor), (x - 4.0, label.middle)]);
            self.text("label muted", x, baseline(label.middle, font_px::LABEL), &label.text);
        }
        for label in &cell.head.top_labels {
            let row_bottom = frame.top - MARK_ROW_PX * label.row as f64;
            leaders.polyline([(label.anchor, frame.top), (label.anchor, row_bottom - MARK_ROW_PX + 2.0)]);
            self.text("label muted", label.start(), row_bottom - 0.3 * MARK_ROW_PX, &label.text);
        }
        self.path("hair axis", &leaders);
    }
}

/// Returns the style class of a line that `covers` other lines cover; empty for an uncovered line.
fn under(covers: usize) -> String {
    if covers == 0 { String::new() } else { format!("under{covers}") }
}

/// Returns true for a log axis that is long enough for minor grid lines, which show that it is logarithmic.
fn has_minor_grid(domain: &Domain, length_px: f64) -> bool {
    domain.scale == Scale::Log && length_px >= MINOR_GRID_DECADE_PX * domain.span()
}
