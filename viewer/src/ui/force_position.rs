//! Plot of force over position, with the slope of the curve and the area of its loop.

use crate::palette::Palette;
use crate::ui::overlay::shortened;
use crate::ui::plots::{marks, plain, short, y_axis};
use egui::{Color32, RichText, TextStyle, Ui, Vec2};
use egui_plot::{AxisHints, Line, Plot, PlotPoints, Points};
use flotor_history::History;
use flotor_history::derived::ForcePosition;
use flotor_history::quantity::{Quantity, Units};

/// Smallest width for a name beside the choice of the axis, points.
const ROOM_FOR_NAME_PT: f32 = 230.0;
/// Smallest height of the plot, points; the text above is shortened or left out for it.
const LEAST_PLOT_PT: f32 = 90.0;
/// Largest number of points drawn.
const MOST_POINTS: usize = 2000;

/// Curve of force over position along an axis, cached from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct ForcePositionPlot {
    /// Axis, 0 to 2 (x, y, z); `None`: not shown.
    pub axis: Option<usize>,
    made_of: Option<(usize, [u64; 2])>,
    curve: ForcePosition,
}

impl ForcePositionPlot {
    /// Hides the shown plot, or shows the plot for the axis z.
    pub fn toggle(&mut self) {
        self.axis = if self.axis.is_some() { None } else { Some(2) };
    }

    /// Returns the curve of the chosen axis between two times, s; `None` if not shown.
    pub fn curve(&mut self, history: &History, span_s: [f64; 2]) -> Option<&ForcePosition> {
        let axis = self.axis?;
        let made_of =
            (axis, [history.number_at(span_s[0]), history.number_at(span_s[1].min(history.span_s()[1]))]);
        if self.made_of != Some(made_of) {
            self.curve = ForcePosition::of(history.between(span_s[0], span_s[1]), axis);
            self.made_of = Some(made_of);
        }
        Some(&self.curve)
    }

    /// Discards the cached curve, for another run or device.
    pub fn start_over(&mut self) {
        self.made_of = None;
    }

    /// Shows the curve in the available area, with the sample at the cursor as a dot.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        (history, cursor_s): (&History, f64),
        span_s: [f64; 2],
        units: Units,
        palette: &Palette,
    ) {
        let Some(mut axis) = self.axis else { return };
        let (length, per_m) = Quantity::Position.unit(units);
        ui.horizontal(|ui| {
            if ui.available_width() >= ROOM_FOR_NAME_PT {
                ui.strong("Force over position");
            }
            // A picture, without a cursor, has no buttons.
            if cursor_s.is_nan() {
                ui.weak(Quantity::Position.components()[axis]);
                return;
            }
            for (number, name) in Quantity::Position.components().iter().enumerate() {
                let color = if number == axis { Color32::WHITE } else { palette.faint };
                ui.selectable_value(&mut axis, number, RichText::new(*name).color(color));
            }
        });
        self.axis = Some(axis);
        let Some(curve) = self.curve(history, span_s) else { return };
        let said = said(curve, units);
        text_above(ui, &said);
        let points: Vec<[f64; 2]> = curve.thinned(MOST_POINTS).map(|[x, force]| [x * per_m, force]).collect();
        let name = Quantity::Position.components()[axis];
        let x_axis =
            AxisHints::new_x().formatter(|mark, _| short(mark.value)).label(format!("{name}, {length}"));
        let plot = Plot::new(("force over position", axis))
            .min_size(Vec2::ZERO)
            .height(ui.available_height())
            .custom_x_axes(vec![x_axis])
            .custom_y_axes(vec![y_axis(44.0).label("N")])
            .x_grid_spacer(|grid| marks(grid.bounds));
        let least = |quantity: Quantity| quantity.least_range(units);
        let [along, across] = least_ranges(&points, [least(Quantity::Position), least(Quantity::Force)]);
        let plot = along.into_iter().fold(plain(plot, palette), Plot::include_x);
        let plot = across.into_iter().fold(plot, Plot::include_y);
        let shown = plot.show(ui, |plot| {
            let line = Line::new("curve", PlotPoints::from(points)).allow_band(false);
            plot.line(line.color(palette.components[axis]).width(1.4));
            if let Some(sample) = history.seen_at(cursor_s) {
                let at = [Quantity::Position, Quantity::Force].map(|quantity| quantity.value(sample, axis));
                let dot = Points::new("moment", vec![[at[0] * per_m, at[1]]]).radius(4.0);
                plot.points(dot.color(palette.cursor));
            }
        });
        let label = format!("Force over position, N and {length}: {said}");
        shown.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &label));
    }
}

/// Returns, for each axis of some points, the ends of a range about the middle of the points, as wide as the smallest range of the axis:
/// smaller differences are rounding.
fn least_ranges(points: &[[f64; 2]], least: [f64; 2]) -> [[f64; 2]; 2] {
    std::array::from_fn(|axis| {
        let values = points.iter().map(|point| point[axis]);
        let ends = values.fold([f64::MAX, f64::MIN], |[low, high], value| [low.min(value), high.max(value)]);
        let middle = if points.is_empty() { 0.0 } else { 0.5 * (ends[0] + ends[1]) };
        [-0.5, 0.5].map(|part| middle + part * least[axis])
    })
}

/// Shows slopes and area above the plot if the plot keeps its smallest height: in several lines, in one line with "…", or not.
fn text_above(ui: &mut Ui, text: &str) {
    let (font, color) = (TextStyle::Body.resolve(ui.style()), ui.visuals().weak_text_color());
    let (width_pt, room_pt) = (ui.available_width(), ui.available_height() - LEAST_PLOT_PT);
    let whole = ui.painter().layout(text.to_owned(), font.clone(), color, width_pt);
    let line = shortened(ui.painter(), text, font, color, width_pt);
    if let Some(galley) = [whole, line].into_iter().find(|galley| galley.size().y <= room_pt) {
        ui.label(galley).on_hover_text(text);
    }
}

/// Returns the slopes and the area of a curve as text, each number with its label.
#[must_use]
pub fn said(curve: &ForcePosition, units: Units) -> String {
    let (stiffness, per_si) = Quantity::Stiffness.unit(units);
    let (energy, per_j) = Quantity::Energy.unit(units);
    let slope = |slope: f64| format!("{:.3} {stiffness}", slope * per_si);
    let contact =
        curve.stiffness_n_per_m.map(|fit| format!("stiffness where there is force: {}", slope(fit)));
    let all = curve.stiffness_of_all_n_per_m.map(|fit| format!("line through all: {}", slope(fit)));
    let area = curve.cycles.map(|(cycles, loss_j)| {
        let many = if cycles == 1 { "" } else { "s" };
        format!("hysteresis: {:.4} {energy} a cycle ({cycles} cycle{many})", loss_j * per_j)
    });
    let parts: Vec<String> = contact.into_iter().chain(all).chain(area).collect();
    if parts.is_empty() { "the handle rests".to_owned() } else { parts.join("  ·  ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_differ_by_rounding_are_in_the_middle_of_the_least_range() {
        let points = [[-20.0, 3.0], [-20.0 + 1.0e-12, 3.0 - 1.0e-12]];
        let [along, across] = least_ranges(&points, [1.0e-3, 1.0e-3]);
        assert!((along[0] + 20.0005).abs() < 1.0e-9 && (along[1] + 19.9995).abs() < 1.0e-9, "{along:?}");
        assert!((across[0] - 2.9995).abs() < 1.0e-9 && (across[1] - 3.0005).abs() < 1.0e-9, "{across:?}");
        assert_eq!(least_ranges(&[], [2.0, 4.0]), [[-1.0, 1.0], [-2.0, 2.0]]);
    }
}
