//! Plot of force over position, with the slope of the curve and the area of its loop.

use crate::palette::Palette;
use crate::ui::overlay::shortened;
use crate::ui::plots::{marks, plain, short, y_axis};
use egui::{Color32, RichText, TextStyle, Ui, Vec2};
use egui_plot::{AxisHints, Line, LineStyle, Plot, PlotPoints, Points};
use flotor_history::History;
use flotor_history::derived::ForcePosition;
use flotor_history::quantity::{Quantity, Units};

/// Smallest width for a name beside the choice of the axis, points.
const ROOM_FOR_NAME_PT: f32 = 230.0;
/// Smallest height of the plot, points; the text above is shortened or left out for it.
const LEAST_PLOT_PT: f32 = 90.0;
/// Largest number of points drawn.
const MOST_POINTS: usize = 2000;

/// Curves of force over position along an axis, cached from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct ForcePositionPlot {
    /// Axis, 0 to 2 (x, y, z); `None`: not shown.
    pub axis: Option<usize>,
    made_of: Option<(usize, Vec<[u64; 2]>)>,
    curves: Vec<ForcePosition>,
}

impl ForcePositionPlot {
    /// Hides the shown plot, or shows the plot for the axis z.
    pub fn toggle(&mut self) {
        self.axis = if self.axis.is_some() { None } else { Some(2) };
    }

    /// Returns the curve of each history along an axis between two times, s.
    fn curves(&mut self, histories: &[&History], [from_s, to_s]: [f64; 2], axis: usize) -> &[ForcePosition] {
        let numbers = |history: &&History| [from_s, to_s].map(|at_s| history.number_at(at_s));
        let made_of = Some((axis, histories.iter().map(numbers).collect::<Vec<_>>()));
        if self.made_of != made_of {
            let curve = |history: &&History| ForcePosition::of(history.between(from_s, to_s), axis);
            self.curves = histories.iter().map(curve).collect();
            self.made_of = made_of;
        }
        &self.curves
    }

    /// Discards the cached curves, for another run or device, or another second recording.
    pub fn start_over(&mut self) {
        self.made_of = None;
    }

    /// Shows the curve in the available area, with the sample at the cursor as a dot, and that of a second recording dashed beneath.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        (history, compared, cursor_s): (&History, Option<&History>, f64),
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
        let histories: Vec<&History> = [history].into_iter().chain(compared).collect();
        let curves = self.curves(&histories, span_s, axis);
        let said = curves.iter().map(|curve| said(curve, units)).collect::<Vec<_>>().join("  ·  dashed: ");
        text_above(ui, &said);
        let in_units = |[x, force]: [f64; 2]| [x * per_m, force];
        let mut all = curves.iter().map(|curve| curve.thinned(MOST_POINTS).map(in_units).collect::<Vec<_>>());
        let (points, compared) = (all.next().unwrap_or_default(), all.next().unwrap_or_default());
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
            let dashed = Line::new("compared", PlotPoints::from(compared)).allow_band(false);
            let pale = palette.components[axis].gamma_multiply(0.6);
            plot.line(dashed.color(pale).width(2.8).style(LineStyle::dashed_dense()));
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

/// Returns for each axis a range about the middle of some points, as wide as the least range of the axis: less is rounding.
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
