//! Charts as self-contained SVG documents, used for all pictures of the command line.
//!
//! A [`Figure`] has a title and [`Panel`]s; a panel has axes, [`Series`] of samples and [`Mark`]s (reference lines).
//! [`Figure::to_svg`] lays them out and writes one SVG document that needs no other file, is readable on light and dark pages,
//! scales with the page and contains a text description for screen readers.
//!
//! Design goals:
//! - **No peak is lost, no file is large.** Lines are reduced to at most four samples per pixel column (`decimate`, after Jugel et
//!   al., "M4", VLDB 2014), so the file size for ten minutes at 1 kHz is that for a second. A [`Trace`] reduces samples as they
//!   arrive: its memory does not grow with the run.
//! - **Rounding is not a signal.** An axis covers at least a range that is far above the rounding errors of its [`Quantity`].
//! - **Every series is visible.** A line that later lines cover is drawn wider and paler (`cover`).
//! - **Bad samples stay local.** NaN, infinity, and anything not positive on a log axis break the line there and change neither the
//!   axis range nor the rest of the curve.
//! - **Same input, same bytes.** Coordinates are rounded to a tenth of a pixel; nothing depends on time,
//!   locale or installed fonts.
//!
//! Data flows one way: the model (this file, `series`, `mark`, `spans`) -> `axis` and `ticks` (ranges) -> `layout` and `labels`
//! (places) -> `drawing`, `path` and `svg` (text). `theme` has colours, fonts and line styles.
//!
//! Not real-time: every function here allocates.
//!
//! ```
//! # use flotor_plot::{Axis, Figure, Mark, Panel, Quantity, Series};
//! let force_n = (0..10_000).map(|tick| f64::from(tick) * 1e-3).map(|time_s| (time_s, time_s.sin()));
//! let svg = Figure::new("Run", Axis::linear("Time", "s"))
//!     .panel(
//!         Panel::new(Axis::of("Force on the hand", Quantity::Force))
//!             .series(Series::line("z", force_n))
//!             .mark(Mark::at_y(0.8, "limit 0.8 N")),
//!     )
//!     .to_svg();
//! assert!(svg.starts_with("<svg"));
//! ```

mod axis;
mod clip;
mod cover;
mod decimate;
mod drawing;
mod labels;
mod layout;
mod mark;
mod path;
mod projection;
mod quantity;
mod series;
mod spans;
mod step;
mod svg;
mod text;
mod theme;
mod ticks;
mod trace;
mod vector;

#[cfg(test)]
mod tests;

pub use axis::Axis;
pub use cover::{covered_style, covering_lines};
pub use mark::Mark;
pub use quantity::Quantity;
pub use series::{Bin, ErrorBar, Series};
pub use spans::Spans;
pub use text::escape;
pub use theme::{AXIS_COLORS, FAULT_COLORS, LIMIT_COLORS};
pub use trace::Trace;
pub use vector::VectorTrace;

/// Width of a figure: fits the text column of the book and a laptop screen at full size.
const WIDTH_PX: f64 = 960.0;

/// Default height of a panel's plotting area, see [`Figure::panel_height_px`]: five stacked panels
/// fit one screen.
const DEFAULT_PANEL_HEIGHT_PX: f64 = 120.0;

/// Picture with a title above panels, which fill a grid row by row; one column by default.
///
/// Panels without an x axis of their own share the figure's x axis: one range covers the data of all these panels, and the labels
/// are drawn once at the foot of each column.
#[derive(Debug, Clone)]
#[must_use]
pub struct Figure {
    title: String,
    subtitle: String,
    watermark: String,
    shared_x: Axis,
    columns: usize,
    panel_height_px: f64,
    width_px: f64,
    height_px: Option<f64>,
    paper: Paper,
    scale: f64,
    panels: Vec<Panel>,
    left_out: Vec<String>,
}

impl Figure {
    /// Creates an empty figure with the x axis `shared_x` for its panels.
    pub fn new(title: impl Into<String>, shared_x: Axis) -> Self {
        Self {
            title: title.into(),
            subtitle: String::new(),
            watermark: String::new(),
            shared_x,
            columns: 1,
            panel_height_px: DEFAULT_PANEL_HEIGHT_PX,
            width_px: WIDTH_PX,
            height_px: None,
            paper: Paper::OfReader,
            scale: 1.0,
            panels: Vec::new(),
            left_out: Vec::new(),
        }
    }

    /// Sets the line under the title: conditions of the measurement, seed, versions. Long text wraps.
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// Sets a large pale text behind the panels, for a restriction that applies to every copy of the picture.
    pub fn watermark(mut self, watermark: impl Into<String>) -> Self {
        self.watermark = watermark.into();
        self
    }

    /// Sets the number of panels side by side; 0 counts as 1.
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Sets the height of each plotting area, without headings and tick labels, clamped to 40 px to 2000 px; NaN changes nothing.
    pub fn panel_height_px(mut self, panel_height_px: f64) -> Self {
        if !panel_height_px.is_nan() {
            self.panel_height_px = panel_height_px.clamp(40.0, 2000.0);
        }
        self
    }

    /// Sets width and height of the whole picture, each clamped to 200 px to 8000 px (NaN: 960 px). The plotting areas
    /// divide the height without titles and labels equally, with at least 40 px each.
    pub fn size_px(mut self, [width_px, height_px]: [f64; 2]) -> Self {
        let held = |length: f64| if length.is_nan() { WIDTH_PX } else { length.clamp(200.0, 8000.0) };
        (self.width_px, self.height_px) = (held(width_px), Some(held(height_px)));
        self
    }

    /// Sets the magnification of the picture, text and lines included, clamped to 0.1 to 10; NaN changes nothing.
    pub fn scale(mut self, scale: f64) -> Self {
        if !scale.is_nan() {
            self.scale = scale.clamp(0.1, 10.0);
        }
        self
    }

    /// Selects light or dark colours, or the colour scheme of the page that shows the picture.
    pub fn paper(mut self, paper: Paper) -> Self {
        self.paper = paper;
        self
    }

    /// Adds a panel after the existing ones.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Adds a panel; for an error, adds the error text (name of the quantity and reason) to a note under the subtitle.
    pub fn panel_or_note(mut self, panel: Result<Panel, String>) -> Self {
        match panel {
            Ok(panel) => self.panels.push(panel),
            Err(left_out) => self.left_out.push(left_out),
        }
        self
    }

    /// Returns the note on quantities without a panel; empty if there are none.
    fn note(&self) -> String {
        if self.left_out.is_empty() {
            String::new()
        } else {
            format!("Not drawn: {}.", self.left_out.join(", "))
        }
    }

    /// Returns the picture as one SVG document. Never fails: a panel without data contains the text "no data".
    #[must_use]
    pub fn to_svg(&self) -> String {
        let layout = layout::arrange(self);
        let Some(height_px) = self.height_px else { return svg::document(self, &layout) };
        let rows = self.panels.len().div_ceil(self.columns).max(1) as f64;
        let fitted = self.clone().panel_height_px(self.panel_height_px + (height_px - layout.height) / rows);
        svg::document(&fitted, &layout::arrange(&fitted))
    }
}

/// Colour scheme of a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Paper {
    /// Light, or dark if the reader's browser is in dark mode.
    #[default]
    OfReader,
    /// Light, for print.
    Light,
    /// Dark, for slides.
    Dark,
}

/// Plotting area with axes, series and marks.
#[derive(Debug, Clone)]
#[must_use]
pub struct Panel {
    title: String,
    own_x: Option<Axis>,
    y: Axis,
    series: Vec<Series>,
    marks: Vec<Mark>,
    limited: Vec<Spans>,
}

impl Panel {
    /// Creates an empty panel with the figure's x axis. The label of the y axis is the panel's heading.
    pub fn new(y: Axis) -> Self {
        Self {
            title: String::new(),
            own_x: None,
            y,
            series: Vec::new(),
            marks: Vec::new(),
            limited: Vec::new(),
        }
    }

    /// Creates an empty panel with an x axis of its own.
    pub fn with_x(x: Axis, y: Axis) -> Self {
        Self { own_x: Some(x), ..Self::new(y) }
    }

    /// Sets the first part of the heading, before the label of the y axis, for panels that show the same quantity in different cases.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a series, drawn over the series added before.
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds a reference line or a fault.
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// Adds a bar along the foot of the panel over the intervals of x in which a limit acted.
    pub fn limited(mut self, spans: Spans) -> Self {
        self.limited.push(spans);
        self
    }
}
