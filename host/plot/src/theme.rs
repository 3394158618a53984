//! Theme of pictures: colours, dash patterns, markers, type sizes and the style sheet.
//!
//! Series colours are the colour-blind-safe palette of Okabe and Ito ("Color Universal Design", 2008), ordered by contrast. Its
//! yellow, unreadable on white, is replaced by the neutral grey that many tools add to the palette; its black is the text colour,
//! and so is light on a dark page. Series also differ in dash pattern or marker shape.

use super::Paper;
use super::path::Path;

/// Series colours on a light and on a dark page.
const PALETTE: [(&str, &str); 8] = [
    ("#0072b2", "#3a9bdc"), // blue, lightened on dark for contrast
    ("#d55e00", "#e8702a"), // vermillion
    ("#009e73", "#18b98c"), // bluish green
    ("#cc79a7", "#d98bb6"), // reddish purple
    ("#e69f00", "#e69f00"), // orange
    ("#56b4e9", "#8fd0f5"), // sky blue
    ("#1f2328", "#e6edf3"), // black: the text colour
    ("#8a8f98", "#8a8f98"), // grey
];

/// Colours of the components x, y and z on a light and on a dark page, the same as in the viewer's window.
pub const AXIS_COLORS: [(&str, &str); 3] =
    [("#d55e00", "#e69f00"), ("#008c69", "#009e76"), ("#144a9b", "#96d0ff")];

/// Colours of faults on a light and a dark page, the same as in the viewer's window.
pub const FAULT_COLORS: (&str, &str) = ("#c4003c", "#ff6082");

/// Colours of limits on a light and a dark page, the same as in the viewer's window.
pub const LIMIT_COLORS: (&str, &str) = ("#603400", "#ffe86e");

/// Dash patterns: alternating lengths of dashes and gaps, pixels; the first is solid.
const DASHES: [&str; 8] = ["", "8 3", "3 2", "9 3 2 3", "15 4", "6 2 1.5 2 1.5 2", "1.5 2", "11 3 4 3"];

/// Colour, dash and marker of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Slot {
    color: usize,
    cue: usize,
    weight: Weight,
}

/// Weight of a line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Weight {
    #[default]
    Full,
    /// Thin, solid and pale: one of many.
    Faint,
}

impl Slot {
    /// Returns the style of series `index`. After each round of colours the dashes and markers shift by one, so that 64 styles are
    /// distinct.
    pub(super) fn new(index: usize) -> Self {
        let color = index % PALETTE.len();
        Self { color, cue: (color + index / PALETTE.len()) % DASHES.len(), weight: Weight::Full }
    }

    /// Returns the style of vector component 0, 1 or 2 (x, y or z), the same in every panel.
    pub(super) fn of_axis(component: usize) -> Self {
        let component = component % AXIS_COLORS.len();
        Self { color: PALETTE.len() + component, cue: component, weight: Weight::Full }
    }

    /// Returns the style with another weight.
    pub(super) fn with_weight(self, weight: Weight) -> Self {
        Self { weight, ..self }
    }

    pub(super) fn is_faint(self) -> bool {
        self.weight == Weight::Faint
    }

    /// Returns the style classes for a stroke in the series colour.
    pub(super) fn stroke_class(self) -> String {
        match self.weight {
            Weight::Full => format!("s{}", self.color),
            Weight::Faint => format!("faint s{}", self.color),
        }
    }

    /// Returns the style class for an area in the series colour.
    pub(super) fn fill_class(self) -> String {
        format!("f{}", self.color)
    }

    /// Returns the dash pattern; empty for a solid line. Components are solid, as in the viewer's window.
    pub(super) fn dash(self) -> &'static str {
        if self.color >= PALETTE.len() || self.is_faint() {
            return "";
        }
        DASHES.get(self.cue).copied().unwrap_or_default()
    }

    /// Adds the marker to `path`, centred on (x, y): eight shapes of similar area.
    pub(super) fn add_marker(self, path: &mut Path, x: f64, y: f64) {
        match self.cue {
            0 => path.circle(x, y, 3.0),
            1 => path.polygon(x, y, &[(-2.7, -2.7), (2.7, -2.7), (2.7, 2.7), (-2.7, 2.7)]),
            2 => path.polygon(x, y, &[(0.0, -3.8), (3.7, 2.8), (-3.7, 2.8)]),
            3 => path.polygon(x, y, &[(0.0, -4.0), (3.4, 0.0), (0.0, 4.0), (-3.4, 0.0)]),
            4 => path.polygon(x, y, &[(0.0, 3.8), (3.7, -2.8), (-3.7, -2.8)]),
            5 => path.polygon(x, y, &plus_outline(3.6, 1.1)),
            6 => path.polygon(x, y, &cross_outline(3.3, 1.2)),
            // Ring, wide enough to surround another marker.
            _ => path.ring(x, y, 5.2, 4.1),
        }
    }
}

/// Returns the corners of a plus sign with arms of length `reach` and half width `half`: the upper arm with its inner corner,
/// rotated by quarter turns.
fn plus_outline(reach: f64, half: f64) -> [(f64, f64); 12] {
    let arm = [(-half, -reach), (half, -reach), (half, -half)];
    std::array::from_fn(|corner| (0..corner / 3).fold(arm[corner % 3], |(x, y), _| (-y, x)))
}

/// Returns the plus sign rotated by an eighth of a turn.
fn cross_outline(reach: f64, half: f64) -> [(f64, f64); 12] {
    use std::f64::consts::FRAC_1_SQRT_2;
    plus_outline(reach * 1.2, half).map(|(x, y)| (FRAC_1_SQRT_2 * (x - y), FRAC_1_SQRT_2 * (x + y)))
}

/// Font sizes in pixels, used by style sheet and layout.
pub(super) mod font_px {
    pub(in super::super) const TITLE: f64 = 18.0;
    pub(in super::super) const SUBTITLE: f64 = 12.5;
    pub(in super::super) const HEADING: f64 = 12.5;
    pub(in super::super) const LABEL: f64 = 11.5;
    pub(in super::super) const TICK: f64 = 11.0;
}

/// Returns the style sheet: all rules are under `.plot`, so that a picture in a page does not affect the page.
/// Colours are given twice, the second time for pages in dark mode.
///
/// CairoSVG, svglib, Inkscape, librsvg and browsers support all rules: plain colours for `fill` and `stroke`, no inherited font
/// size, and no size of the picture, which is in the attributes of the root.
pub(super) fn style_sheet(paper: Paper) -> String {
    use font_px::{HEADING, LABEL, SUBTITLE, TICK, TITLE};
    let light = Page { paper: "#ffffff", ink: "#1f2328", muted: "#59636e", axis: "#8c959f", grid: "#e7eaee" };
    let dark = Page { paper: "#0d1117", ink: "#e6edf3", muted: "#9198a1", axis: "#656c76", grid: "#232a33" };
    let (light, dark) = (light.rules(|(light, _)| light), dark.rules(|(_, dark)| dark));
    format!(
        ".plot{{font-family:system-ui,-apple-system,'Segoe UI',Roboto,\
         'Helvetica Neue','Noto Sans','DejaVu Sans',sans-serif;font-variant-numeric:tabular-nums}}\n\
         .plot text{{font-size:{TICK}px}}\n\
         .plot .title{{font-size:{TITLE}px;font-weight:600}}\n\
         .plot .subtitle{{font-size:{SUBTITLE}px}}\n\
         .plot .heading{{font-size:{HEADING}px;font-weight:600}}\n\
         .plot .watermark{{font-weight:600;fill-opacity:.13}}\n\
         .plot .unit{{font-weight:400}}\n\
         .plot .label{{font-size:{LABEL}px}}\n\
         .plot .middle{{text-anchor:middle}}\n\
         .plot .end{{text-anchor:end}}\n\
         .plot .hair{{fill:none;stroke-width:1}}\n\
         .plot .minor{{stroke-opacity:.5}}\n\
         .plot .reference{{fill:none;stroke-width:1;stroke-dasharray:5 3}}\n\
         .plot .line{{fill:none;stroke-width:1.6;stroke-linejoin:round}}\n\
         .plot .busy{{stroke-width:1}}\n\
         .plot .round{{stroke-linecap:round}}\n\
         .plot .faint{{stroke-width:1;stroke-opacity:.55}}\n\
         .plot .under1{{stroke-width:5;stroke-opacity:.45}}\n\
         .plot .under2{{stroke-width:8.4;stroke-opacity:.45}}\n\
         .plot .under3{{stroke-width:11.8;stroke-opacity:.45}}\n\
         .plot .errors{{fill:none;stroke-width:1.8}}\n\
         .plot .fault{{fill:none;stroke-width:1.6}}\n\
         .plot .points{{fill-opacity:.85}}\n\
         .plot .bars{{fill-opacity:.16;stroke-width:1.2}}\n\
         {}",
        match paper {
            Paper::Light => light,
            Paper::Dark => dark,
            Paper::OfReader => format!("{light}@media (prefers-color-scheme:dark){{\n{dark}}}\n"),
        },
    )
}

/// Colours of all parts except series, faults and limits.
struct Page {
    paper: &'static str,
    ink: &'static str,
    muted: &'static str,
    axis: &'static str,
    grid: &'static str,
}

impl Page {
    /// Returns the rules for text, grid, axes, faults and limits, then two rules for each series colour: `s0` for strokes, `f0` for
    /// areas.
    fn rules(&self, series_color: impl Fn((&'static str, &'static str)) -> &'static str) -> String {
        let Self { paper, ink, muted, axis, grid } = self;
        let mut rules = format!(
            ".plot .paper{{fill:{paper}}}\n\
             .plot text{{fill:{ink}}}\n\
             .plot .muted{{fill:{muted}}}\n\
             .plot .grid{{stroke:{grid}}}\n\
             .plot .axis{{stroke:{axis}}}\n\
             .plot .reference{{stroke:{muted}}}\n\
             .plot .fault{{stroke:{fault}}}\n\
             .plot .limited{{fill:{limit}}}\n",
            fault = series_color(FAULT_COLORS),
            limit = series_color(LIMIT_COLORS),
        );
        for (index, colors) in PALETTE.into_iter().chain(AXIS_COLORS).enumerate() {
            let color = series_color(colors);
            rules.push_str(&format!(".plot .s{index}{{stroke:{color}}}\n.plot .f{index}{{fill:{color}}}\n"));
        }
        rules
    }
}
