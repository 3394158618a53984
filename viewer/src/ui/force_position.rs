//! Force over position: the curve that a hand feels, its slope, and the area of its loop.

use crate::palette::Palette;
use crate::ui::plots::{marks, plain, short, y_axis};
use egui::{Color32, RichText, Ui};
use egui_plot::{AxisHints, Line, Plot, PlotPoints, Points};
use flotor_history::History;
use flotor_history::derived::ForcePosition;
use flotor_history::quantity::{Quantity, Units};

/// Narrower, the choice of the axis has the row alone, points.
const ROOM_FOR_NAME_PT: f32 = 230.0;
/// Points drawn at most.
const MOST_POINTS: usize = 2000;

/// The curve of an axis, kept from picture to picture.
#[derive(Clone, Debug, Default)]
pub struct ForcePositionPlot {
    /// The axis, x, y or z; none while it is not shown.
    pub axis: Option<usize>,
    made_of: Option<(usize, [u64; 2])>,
    curve: ForcePosition,
}

impl ForcePositionPlot {
    /// Shows it, or puts it away.
    pub fn toggle(&mut self) {
        self.axis = if self.axis.is_some() { None } else { Some(2) };
    }

    /// The curve of the chosen axis between two times, s.
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

    /// Forgets what was made of another run or device.
    pub fn start_over(&mut self) {
        self.made_of = None;
    }

    /// Shows the curve in all of the room there is, with the moment of the cursor as a dot.
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
            // A picture, in which no moment is shown, has nothing to press.
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
        ui.weak(&said);
        let points: Vec<[f64; 2]> = curve.thinned(MOST_POINTS).map(|[x, force]| [x * per_m, force]).collect();
        let name = Quantity::Position.components()[axis];
        let x_axis =
            AxisHints::new_x().formatter(|mark, _| short(mark.value)).label(format!("{name}, {length}"));
        let plot = Plot::new(("force over position", axis))
            .custom_x_axes(vec![x_axis])
            .custom_y_axes(vec![y_axis(44.0).label("N")])
            .x_grid_spacer(|grid| marks(grid.bounds));
        let shown = plain(plot, palette).show(ui, |plot| {
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

/// Returns the slopes and the area of a curve in words: what each number is stands beside it.
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
