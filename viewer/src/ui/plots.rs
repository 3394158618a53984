//! Plots of traces over time.

use crate::palette::Palette;
use crate::trace::Trace;
use crate::ui::overlay::{shortened, width_pt};
use crate::ui::style::quiet;
use crate::ui::zoom::{Wheel, ZoomRequest, requested};
use egui::{Align, Layout, Stroke, TextStyle, Ui, vec2};
use egui_plot::{
    AxisHints, GridMark, HPlacement, Line, LineStyle, Plot, PlotPoint, PlotPoints, PlotUi, VLine,
};
use flotor_history::History;
use flotor_history::quantity::{Quantity, Units};
use flotor_plot::{covered_style, covering_lines};

/// Display options of a plot.
#[derive(Clone, Copy, Debug)]
pub struct PlotView<'a> {
    /// Name of the device, if there are several.
    pub device: Option<&'a str>,
    /// First and last displayed time, s.
    pub span_s: [f64; 2],
    /// Time of the cursor, s; NaN: no cursor.
    pub cursor_s: f64,
    /// Units of the axis.
    pub units: Units,
    /// Height, points.
    pub height: f32,
    /// True to draw a time axis beneath, for the lowest plot of a stack.
    pub time_axis: bool,
    /// Smallest and largest value shown, in `units`; `None`: all values.
    pub values: Option<[f64; 2]>,
    /// State of the button for maximising.
    pub maximise: Maximise,
    /// Effect of the wheel.
    pub wheel: Wheel,
}

/// State of a trace regarding maximising.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maximise {
    /// Not possible: the only trace, or a picture.
    No,
    /// Possible: one of several traces.
    Possible,
    /// Maximised.
    Done,
}

/// User input to a plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotAnswer {
    /// Time selected by the pointer, s.
    pub seek_s: Option<f64>,
    /// Time under the pointer, s.
    pub hover_s: Option<f64>,
    /// Request for a zoom.
    pub zoom: Option<ZoomRequest>,
    /// True if the button for maximising was pressed.
    pub switches_maximised: bool,
    /// Area of the traces, points.
    pub frame: egui::Rect,
}

/// Samples of a device, and the decimated trace of a quantity.
pub struct Lines<'a> {
    /// Samples of a device.
    pub history: &'a History,
    /// Trace of the samples, updated by drawing.
    pub trace: &'a mut Trace,
}

/// Shows a quantity over time, with the dashed trace of a second recording beneath. The heading has names and values of the components at
/// the cursor.
pub fn plot(
    ui: &mut Ui,
    Lines { history, trace }: Lines<'_>,
    compared: Option<Lines<'_>>,
    view: PlotView<'_>,
    palette: &Palette,
) -> PlotAnswer {
    let PlotView { span_s, cursor_s, units, height, time_axis, values, .. } = view;
    let quantity = trace.quantity();
    let (unit, per_si) = quantity.unit(units);
    let switches_maximised = heading(ui, history, quantity, &view, palette);

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // points
    let buckets = ui.available_width().max(50.0) as usize;
    let traces = trace.points(history, span_s, buckets, per_si);
    let compared = compared.map(|Lines { history, trace }| trace.points(history, span_s, buckets, per_si));

    // Leave room for the number at the last mark of the values.
    #[allow(clippy::cast_possible_truncation)] // a part
    let margin = (1.3 * part_of_number(height) as f32).max(0.08);
    let y_axis = y_axis(52.0);
    let x_axis = AxisHints::new_x().formatter(|mark, _| format!("{} s", short(mark.value)));
    // A plot keeps its bounds once set, so a plot of all values and a zoomed plot have different ids.
    let plot = Plot::new(("plot", quantity.name(), values.is_some()))
        .height(height)
        .show_axes([time_axis, true])
        .custom_x_axes(vec![x_axis])
        .custom_y_axes(vec![y_axis])
        .set_margin_fraction(vec2(0.0, margin))
        .include_x(span_s[0])
        .include_x(span_s[1]);
    let plot = plain(plot, palette).y_grid_spacer(move |grid| marks_inside(grid.bounds, height));
    // Zero is visible unless the user chose other values.
    // Differences smaller than the least range are rounding.
    let least = 0.5 * quantity.least_range(units);
    let plot = if values.is_none() { plot.include_y(-least).include_y(least) } else { plot };
    let shown = plot.show(ui, |plot| {
        plot.set_plot_bounds_x(span_s[0]..=span_s[1]);
        if let Some([low, high]) = values {
            plot.set_plot_bounds_y(low..=high);
        }
        for (component, stretches) in compared.iter().flat_map(|traces| traces.iter().enumerate()) {
            for points in stretches {
                // Wide and pale enough to be visible beside a line on top.
                let line = Line::new("", PlotPoints::Borrowed(points)).allow_band(false);
                let color = palette.components[component % 3].gamma_multiply(0.6);
                plot.line(line.color(color).width(3.2).style(LineStyle::dashed_dense()));
            }
        }
        let covers = covers(plot, traces);
        for ((component, stretches), covers) in traces.iter().enumerate().zip(covers) {
            let name = quantity.components()[component];
            let (width, opacity) = covered_style(covers);
            #[allow(clippy::cast_possible_truncation)] // points, and a part
            let (width, opacity) = (LINE_PT * width as f32, opacity as f32);
            for points in stretches {
                // Two points per bucket are few enough for joined lines of uniform width.
                let line = Line::new(name, PlotPoints::Borrowed(points)).allow_band(false);
                let color = palette.components[component % 3].gamma_multiply(opacity);
                plot.line(line.color(color).width(width));
            }
        }
        if cursor_s.is_finite() {
            plot.vline(VLine::new("time", cursor_s).stroke(Stroke::new(1.2, palette.cursor)));
        }
        plot.pointer_coordinate()
    });
    let of_device = view.device.map(|name| format!("{name}: ")).unwrap_or_default();
    let time = format!("{of_device}{} over time, {unit}", quantity.name());
    shown.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &time));
    let hover_s = shown.inner.map(|at| at.x).filter(|_| shown.response.hovered());
    let pressed =
        shown.response.is_pointer_button_down_on() && ui.input(|input| input.pointer.primary_down());
    PlotAnswer {
        seek_s: shown.inner.map(|at| at.x).filter(|_| pressed),
        hover_s,
        zoom: requested(ui, &shown, view.wheel, palette),
        switches_maximised,
        frame: *shown.transform.frame(),
    }
}

/// Width of a trace, points.
const LINE_PT: f32 = 1.6;

/// Counts, for each component, the later components whose traces cover its trace, as for SVG pictures.
fn covers(plot: &PlotUi<'_>, traces: &[Vec<Vec<PlotPoint>>]) -> Vec<usize> {
    let on_screen = |point: &PlotPoint| {
        let at = plot.screen_from_plot(*point);
        (f64::from(at.x), f64::from(at.y))
    };
    let run = |points: &Vec<PlotPoint>| points.iter().map(on_screen).collect::<Vec<_>>();
    let lines: Vec<Vec<Vec<(f64, f64)>>> =
        traces.iter().map(|stretches| stretches.iter().map(run).collect()).collect();
    let frame = plot.transform().frame();
    covering_lines(&lines, [frame.left(), frame.right()].map(f64::from))
}

/// Disables the plot's own mouse handling and decoration: the caller reads the mouse, and only lines and grid are drawn.
pub(super) fn plain<'a>(plot: Plot<'a>, palette: &Palette) -> Plot<'a> {
    plot.allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .show_background(false)
        .show_crosshair(false)
        .grid_color(palette.grid)
        .y_grid_spacer(|grid| marks(grid.bounds))
        .grid_spacing(egui::Rangef::new(8.0, 60.0))
        .label_formatter(|_| None)
}

/// Returns the marks of an axis of this height, points, without marks at the ends, whose numbers would overlap the text beyond.
fn marks_inside(bounds: (f64, f64), height_pt: f32) -> Vec<GridMark> {
    let margin = (bounds.1 - bounds.0) * part_of_number(height_pt);
    let is_inside = |mark: &GridMark| mark.value >= bounds.0 + margin && mark.value <= bounds.1 - margin;
    marks(bounds).into_iter().filter(is_inside).collect()
}

/// Returns half the height of a number as a fraction of an axis of this height, points.
fn part_of_number(height_pt: f32) -> f64 {
    const HALF_PT: f64 = 6.0;
    (HALF_PT / f64::from(height_pt)).min(0.2)
}

/// Returns an axis of values at the left, of at least this width, points.
pub(super) fn y_axis<'a>(least_pt: f32) -> AxisHints<'a> {
    AxisHints::new_y()
        .placement(HPlacement::Left)
        .min_thickness(least_pt)
        .label_spacing(egui::Rangef::new(11.0, 30.0))
        .formatter(|mark, _| short(mark.value))
}

/// Shows name, unit and values at the cursor; returns whether the button for maximising was pressed.
///
/// In a narrow plot the values are left out first, then the names of the components; the name of the device is shortened.
fn heading(
    ui: &mut Ui,
    history: &History,
    quantity: Quantity,
    view: &PlotView<'_>,
    palette: &Palette,
) -> bool {
    let (unit, _) = quantity.unit(view.units);
    let mut pressed = false;
    ui.allocate_ui_with_layout(
        vec2(ui.available_width(), HEADING_PT),
        Layout::right_to_left(Align::Center),
        |ui| {
            let button = match view.maximise {
                Maximise::No => None,
                Maximise::Possible => Some(("🗖", format!("{} alone (M)", quantity.name()))),
                Maximise::Done => Some(("🗗", "All traces (M)".to_owned())),
            };
            pressed = button.is_some_and(|(sign, help)| quiet(ui, sign, &help).clicked());
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.add_space(4.0);
                let (values, values_pt) = values_with_room(ui, history, quantity, view);
                if let Some(device) = view.device {
                    let most_pt = ui.available_width() - values_pt - name_pt(ui, quantity, unit);
                    shortened_label(ui, device, most_pt);
                }
                ui.strong(quantity.name());
                ui.weak(unit);
                for (component, name, value) in values {
                    ui.add_space(COMPONENT_GAP_PT);
                    ui.colored_label(palette.components[component % 3], name);
                    if !value.is_empty() {
                        ui.monospace(value);
                    }
                }
            });
        },
    );
    pressed
}

/// Height of a heading, and additional distance between two components, points.
const HEADING_PT: f32 = 22.0;
const COMPONENT_GAP_PT: f32 = 10.0;
/// Smallest width of a readable name of a device, points.
const LEAST_DEVICE_PT: f32 = 40.0;

/// Returns number, name and value at the cursor of the components that fit beside the name of the quantity, and their width.
fn values_with_room(
    ui: &Ui,
    history: &History,
    quantity: Quantity,
    view: &PlotView<'_>,
) -> (Vec<(usize, &'static str, String)>, f32) {
    let (unit, per_si) = quantity.unit(view.units);
    let sample = history.seen_at(view.cursor_s);
    let value = |component: usize| {
        let value = sample.map_or(f64::NAN, |sample| quantity.value(sample, component) * per_si);
        if view.cursor_s.is_finite() { digits(value, view.units) } else { String::new() }
    };
    let components = || quantity.components().iter().copied().enumerate();
    let with_values = components().map(|(component, name)| (component, name, value(component)));
    let names_only = components().map(|(component, name)| (component, name, String::new()));
    let gap_pt = ui.spacing().item_spacing.x;
    let room_pt = ui.available_width() - name_pt(ui, quantity, unit);
    for parts in [with_values.collect::<Vec<_>>(), names_only.collect()] {
        let part_pt = |(_, name, value): &(usize, &str, String)| {
            let value_pt =
                if value.is_empty() { 0.0 } else { gap_pt + text_pt(ui, value, TextStyle::Monospace) };
            COMPONENT_GAP_PT + 2.0 * gap_pt + text_pt(ui, name, TextStyle::Body) + value_pt
        };
        let parts_pt = parts.iter().map(part_pt).sum::<f32>();
        if parts_pt <= room_pt {
            return (parts, parts_pt);
        }
    }
    (Vec::new(), 0.0)
}

/// Returns the width of the name of a quantity with its unit, points.
fn name_pt(ui: &Ui, quantity: Quantity, unit: &str) -> f32 {
    let gaps_pt = 3.0 * ui.spacing().item_spacing.x + 4.0;
    text_pt(ui, quantity.name(), TextStyle::Body) + text_pt(ui, unit, TextStyle::Body) + gaps_pt
}

fn text_pt(ui: &Ui, text: &str, style: TextStyle) -> f32 {
    width_pt(ui.painter(), text, style.resolve(ui.style()))
}

/// Shows a name, shortened to a width, points, unless the width is too small for a readable name.
fn shortened_label(ui: &mut Ui, name: &str, most_pt: f32) {
    if most_pt >= LEAST_DEVICE_PT {
        let color = ui.visuals().weak_text_color();
        let galley = shortened(ui.painter(), name, TextStyle::Body.resolve(ui.style()), color, most_pt);
        ui.label(galley).on_hover_text(name);
    }
}

/// Formats a number for these units: in SI with more decimals, which metres and joules need.
#[must_use]
pub fn digits(value: f64, units: Units) -> String {
    match units {
        Units::Handy => fixed(value),
        Units::Si if value.abs() < 10.0 => without_minus_of_zero(format!("{value:+9.6}")),
        Units::Si if value.abs() < 1000.0 => format!("{value:+9.4}"),
        Units::Si => format!("{:>9}", fixed(value)),
    }
}

/// Removes the minus from a number that is zero in the digits shown.
fn without_minus_of_zero(text: String) -> String {
    let is_zero = !text.contains(|digit: char| ('1'..='9').contains(&digit));
    if is_zero { text.replace('-', "+") } else { text }
}

/// Formats a number in seven characters, regardless of its magnitude; "–" if not finite.
#[must_use]
pub fn fixed(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => "      –".to_owned(),
        size if size < 10.0 => without_minus_of_zero(format!("{value:+7.3}")),
        size if size < 100.0 => format!("{value:+7.2}"),
        size if size < 9_999.9 => format!("{value:+7.1}"),
        size if size < 999_999.0 => format!("{value:+7.0}"),
        _ => format!("{value:+7.0e}"),
    }
}

/// Returns three to six marks of an axis at steps of 1, 2 or 5 times a power of ten.
#[allow(clippy::cast_possible_truncation)] // a handful
pub(super) fn marks((low, high): (f64, f64)) -> Vec<GridMark> {
    let wanted = (high - low) / 4.0;
    if !(wanted > 0.0 && wanted.is_finite()) {
        return Vec::new();
    }
    let power = 10.0_f64.powf(wanted.log10().floor());
    let step_size =
        [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= wanted).unwrap_or(wanted);
    let (first, last) = ((low / step_size).ceil() as i64, (high / step_size).floor() as i64);
    (first..=last).map(|k| GridMark { value: k as f64 * step_size, step_size }).collect()
}

/// Formats an axis tick label with at most six decimals, without trailing zeros; negative zero is formatted as `0`.
pub(super) fn short(value: f64) -> String {
    let rounded = (value * 1.0e6).round() / 1.0e6;
    if rounded == 0.0 { "0".to_owned() } else { format!("{rounded}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_columns() {
        for value in [0.0, -1.5, 12.345, -123.45, 99_999.0, f64::NAN, f64::INFINITY, 1.0e9] {
            assert_eq!(fixed(value).chars().count(), 7, "{value}: `{}`", fixed(value));
        }
        for value in [0.0, 1.0e-6, -0.005_123, 12.5, -999.9, 1.0e6, f64::NAN] {
            let text = digits(value, Units::Si);
            assert_eq!(text.chars().count(), 9, "{value}: `{text}`");
        }
        assert_eq!([fixed(-0.000_4), fixed(-0.0), fixed(-0.000_6)], [" +0.000", " +0.000", " -0.001"]);
        assert_eq!(digits(-4e-7, Units::Si), "+0.000000");
        assert_eq!(digits(0.001_234, Units::Si), "+0.001234", "a millimetre has its micrometres");
        assert_eq!(short(-1.0e-12), "0");
        assert_eq!(short(0.1 + 0.2), "0.3");
    }

    #[test]
    fn an_axis_has_a_few_round_marks() {
        for (low, high) in [(-1.5, 8.0), (0.0, 1.0e-9), (-7.0e5, 3.0), (99.0, 101.0)] {
            let marks = marks((low, high));
            assert!((2..=6).contains(&marks.len()), "{low} to {high}: {}", marks.len());
            assert!(marks.iter().all(|mark| mark.value >= low && mark.value <= high));
        }
        assert!(marks((1.0, 1.0)).is_empty() && marks((0.0, f64::NAN)).is_empty());
    }
}
