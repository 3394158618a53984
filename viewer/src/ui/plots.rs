//! Traces over time.

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

/// How a plot is shown.
#[derive(Clone, Copy, Debug)]
pub struct PlotView<'a> {
    /// Name of the device it is of, where there are several.
    pub device: Option<&'a str>,
    /// First and last time, s.
    pub span_s: [f64; 2],
    /// Where the time is, s.
    pub cursor_s: f64,
    /// Units of the axis.
    pub units: Units,
    /// Height, points.
    pub height: f32,
    /// Whether time stands beneath: the lowest of a stack.
    pub time_axis: bool,
    /// Smallest and largest value shown, in these units; without them, all that there are.
    pub values: Option<[f64; 2]>,
    /// Whether it can have the room of all.
    pub maximise: Maximise,
    /// Effect of the wheel.
    pub wheel: Wheel,
}

/// Whether a trace can have the room of all, and whether it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maximise {
    /// There is no other, or this is a picture.
    No,
    /// It can.
    Possible,
    /// It has.
    Done,
}

/// What a person did to a plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotAnswer {
    /// Time the pointer asks for, s.
    pub seek_s: Option<f64>,
    /// Time under the pointer, s.
    pub hover_s: Option<f64>,
    /// Another part of it.
    pub zoom: Option<ZoomRequest>,
    /// Whether the button for the room of all was pressed.
    pub switches_maximised: bool,
    /// Where the traces are, points.
    pub frame: egui::Rect,
}

/// Samples, and the trace of a quantity made of them so far.
pub struct Lines<'a> {
    /// The samples.
    pub history: &'a History,
    /// The trace.
    pub trace: &'a mut Trace,
}

/// Shows one quantity over time, and dashed beneath it the same of a second recording. The components' names and values at the cursor
/// stand above.
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

    // The mark at the end of the values has room for its number.
    #[allow(clippy::cast_possible_truncation)] // a part
    let margin = (1.3 * part_of_number(height) as f32).max(0.08);
    let y_axis = y_axis(52.0);
    let x_axis = AxisHints::new_x().formatter(|mark, _| format!("{} s", short(mark.value)));
    // Bounds once set stay with a plot: one that shows all values is another than one that is zoomed.
    let plot = Plot::new(("plot", quantity.name(), values.is_some()))
        .height(height)
        .show_axes([time_axis, true])
        .custom_x_axes(vec![x_axis])
        .custom_y_axes(vec![y_axis])
        .set_margin_fraction(vec2(0.0, margin))
        .include_x(span_s[0])
        .include_x(span_s[1]);
    let plot = plain(plot, palette).y_grid_spacer(move |grid| marks_inside(grid.bounds, height));
    // Zero is in sight unless somebody chose other values.
    // Smaller differences than the least range are rounding.
    let least = 0.5 * quantity.least_range(units);
    let plot = if values.is_none() { plot.include_y(-least).include_y(least) } else { plot };
    let shown = plot.show(ui, |plot| {
        plot.set_plot_bounds_x(span_s[0]..=span_s[1]);
        if let Some([low, high]) = values {
            plot.set_plot_bounds_y(low..=high);
        }
        for (component, stretches) in compared.iter().flat_map(|traces| traces.iter().enumerate()) {
            for points in stretches {
                // As wide and pale as to be seen beside a line on top of it.
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
                // Two points a bucket are few enough: joined they are as wide everywhere.
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

/// Counts, for each component, the later ones whose trace covers its own, as a picture of lines does.
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

/// A plot that only shows: what the mouse does is read from it, and nothing is drawn but lines and grid.
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

/// Returns the marks of an axis so high, points, without those at its ends: their numbers would stand in the text beyond it.
fn marks_inside(bounds: (f64, f64), height_pt: f32) -> Vec<GridMark> {
    let margin = (bounds.1 - bounds.0) * part_of_number(height_pt);
    let is_inside = |mark: &GridMark| mark.value >= bounds.0 + margin && mark.value <= bounds.1 - margin;
    marks(bounds).into_iter().filter(is_inside).collect()
}

/// Returns half the height of a number as a part of an axis so high, points.
fn part_of_number(height_pt: f32) -> f64 {
    const HALF_PT: f64 = 6.0;
    (HALF_PT / f64::from(height_pt)).min(0.2)
}

/// The axis of values, to the left, at least so wide.
pub(super) fn y_axis<'a>(least_pt: f32) -> AxisHints<'a> {
    AxisHints::new_y()
        .placement(HPlacement::Left)
        .min_thickness(least_pt)
        .label_spacing(egui::Rangef::new(11.0, 30.0))
        .formatter(|mark, _| short(mark.value))
}

/// Shows name, unit and values at the cursor; returns whether the button for the room of all was pressed.
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

/// Height of a heading, and additional distance between two components in it, points.
const HEADING_PT: f32 = 22.0;
const COMPONENT_GAP_PT: f32 = 10.0;
/// A name of a device that is shortened to less says nothing, points.
const LEAST_DEVICE_PT: f32 = 40.0;

/// Returns number, name and value at the cursor of the components that have room beside the name of the quantity, and their width.
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

/// Width of the name of a quantity with its unit, points.
fn name_pt(ui: &Ui, quantity: Quantity, unit: &str) -> f32 {
    let gaps_pt = 3.0 * ui.spacing().item_spacing.x + 4.0;
    text_pt(ui, quantity.name(), TextStyle::Body) + text_pt(ui, unit, TextStyle::Body) + gaps_pt
}

fn text_pt(ui: &Ui, text: &str, style: TextStyle) -> f32 {
    width_pt(ui.painter(), text, style.resolve(ui.style()))
}

/// Shows a name, shortened to a width, points; nothing where nothing of it could be read.
fn shortened_label(ui: &mut Ui, name: &str, most_pt: f32) {
    if most_pt >= LEAST_DEVICE_PT {
        let color = ui.visuals().weak_text_color();
        let galley = shortened(ui.painter(), name, TextStyle::Body.resolve(ui.style()), color, most_pt);
        ui.label(galley).on_hover_text(name);
    }
}

/// A number as it is read in these units: of metres and joules the digits that matter are behind the third place.
#[must_use]
pub fn digits(value: f64, units: Units) -> String {
    match units {
        Units::Handy => fixed(value),
        Units::Si if value.abs() < 10.0 => without_minus_of_zero(format!("{value:+9.6}")),
        Units::Si if value.abs() < 1000.0 => format!("{value:+9.4}"),
        Units::Si => format!("{:>9}", fixed(value)),
    }
}

/// A number that is zero in the digits shown has no minus.
fn without_minus_of_zero(text: String) -> String {
    let is_zero = !text.contains(|digit: char| ('1'..='9').contains(&digit));
    if is_zero { text.replace('-', "+") } else { text }
}

/// A number in seven columns, whatever its size.
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

/// Marks of an axis at steps of 1, 2 or 5 times a power of ten, three to six of them.
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

/// A mark of an axis: no more digits than it has, no minus on zero.
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
