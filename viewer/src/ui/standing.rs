//! Parts of the panel: used fractions of the wrench limits, and counts of events so far.

use crate::event_counts::EventCounts;
use crate::palette::Palette;
use crate::ui::overlay::width_pt;
use crate::ui::plots::short;
use crate::ui::style::SMALL_PT;
use egui::{
    Align, CollapsingHeader, CornerRadius, FontId, Layout, Rect, RichText, Role, Sense, Ui, WidgetInfo, vec2,
};
use flotor_core::trace::Events;
use flotor_history::Sample;
use flotor_history::quantity::{Quantity, Units};
use flotor_live::WrenchLimits;

/// Shows the used fraction of each limit.
pub fn limits(ui: &mut Ui, sample: &Sample, limits: &WrenchLimits, units: Units, palette: &Palette) {
    CollapsingHeader::new(RichText::new("Limits").strong()).default_open(true).show(ui, |ui| {
        if *limits == WrenchLimits::default() {
            ui.label(RichText::new("Not recorded").color(palette.faint));
            return;
        }
        let of_force = (Quantity::Force, limits.force_n, limits.force_norm_n);
        let of_torque = (Quantity::Torque, limits.torque_nm, limits.torque_norm_nm);
        for (quantity, axes, norm) in [of_force, of_torque] {
            let unit = quantity.unit(units);
            let mut squares = 0.0;
            for (component, name) in quantity.components().iter().enumerate() {
                let value = quantity.value(sample, component);
                squares += value * value;
                bar(ui, name, Scale::Signed(value), axes[component], unit, palette);
            }
            bar(ui, "norm", Scale::FromZero(squares.sqrt()), norm, unit, palette);
        }
    });
}

/// Shows a line for each event, counted since the first tick received. A new line moves no control under the pointer, because no
/// control is beneath the lines.
pub fn events(ui: &mut Ui, counted: &EventCounts, palette: &Palette) {
    let title = RichText::new(format!("Events since {:.1} s", counted.since_s())).strong();
    CollapsingHeader::new(title).id_salt("events").default_open(true).show(ui, |ui| {
        let events =
            Events::NAMES.iter().map(|name| name.replace('_', " ")).zip(counted.counts().iter().copied());
        let counts = events.chain([("not shown".to_owned(), counted.dropped)]);
        let happened: Vec<_> = counts.filter(|(_, count)| *count > 0).collect();
        if happened.is_empty() {
            ui.label(RichText::new("No events").color(palette.faint));
        }
        for (name, count) in happened {
            line(ui, &name, &format!("{count} ticks"), palette);
        }
    });
}

fn line(ui: &mut Ui, name: &str, value: &str, palette: &Palette) {
    ui.horizontal(|ui| {
        ui.label(RichText::new(name).color(palette.faint));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(value));
    });
}

/// Scale of a bar with its value, SI.
#[derive(Clone, Copy)]
enum Scale {
    /// Between the negative and the positive limit: zero is in the middle.
    Signed(f64),
    /// Between zero and the limit: zero is at the left.
    FromZero(f64),
}

impl Scale {
    fn text(self, limit: Option<f64>, (unit, per_si): (&str, f64)) -> String {
        let value = match self {
            Self::Signed(value) => format!("{:+.1$}", value * per_si, decimals(limit, per_si)),
            Self::FromZero(value) => format!("{:.1$}", value * per_si, decimals(limit, per_si)),
        };
        match limit {
            Some(limit) => format!("{value} of {} {unit}", short(limit * per_si)),
            None => format!("{value} {unit}"),
        }
    }

    /// Returns the used fraction of the limit, and the filled range of the bar (0 to 1).
    fn parts(self, limit: Option<f64>) -> (f64, [f64; 2]) {
        let of_limit = |value: f64| limit.map_or(0.0, |limit| (value / limit).clamp(-1.0, 1.0));
        match self {
            Self::Signed(value) => {
                let part = of_limit(value);
                (part.abs(), [0.5 + 0.5 * part.min(0.0), 0.5 + 0.5 * part.max(0.0)])
            }
            Self::FromZero(value) => (of_limit(value), [0.0, of_limit(value)]),
        }
    }
}

/// Returns the number of decimals that shows a small fraction of a limit.
fn decimals(limit: Option<f64>, per_si: f64) -> usize {
    if limit.is_some_and(|limit| limit * per_si < 10.0) { 3 } else { 1 }
}

/// Shows a value and its limit as a bar with a text.
fn bar(ui: &mut Ui, name: &str, scale: Scale, limit: Option<f64>, unit: (&str, f64), palette: &Palette) {
    /// Smallest length of a bar, points.
    const LEAST_PT: f32 = 20.0;
    let text = scale.text(limit, unit);
    ui.horizontal(|ui| {
        ui.add_sized(
            vec2(30.0, 14.0),
            egui::Label::new(RichText::new(name).size(SMALL_PT).color(palette.faint)),
        );
        let text_pt = width_pt(ui.painter(), &text, FontId::proportional(SMALL_PT));
        let width = (ui.available_width() - text_pt - 2.0 * ui.spacing().item_spacing.x).max(LEAST_PT);
        let (area, response) = ui.allocate_exact_size(vec2(width, 8.0), Sense::hover());
        let label = format!("{name} {text}");
        response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, &label));
        let painter = ui.painter();
        painter.rect_filled(area, CornerRadius::same(3), palette.grid.gamma_multiply(0.5));
        let (used, [from, to]) = scale.parts(limit);
        #[allow(clippy::cast_possible_truncation)] // points
        let x = |part: f64| area.left() + part as f32 * area.width();
        let filled = Rect::from_x_y_ranges(x(from)..=x(to), area.y_range());
        let color = if used > 0.9 { palette.warning } else { palette.components[2] };
        painter.rect_filled(filled, CornerRadius::same(2), color);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(text).size(SMALL_PT));
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_norm_uses_all_of_its_bar_and_a_component_half_of_it() {
        assert_eq!(Scale::FromZero(70.0).parts(Some(140.0)), (0.5, [0.0, 0.5]));
        assert_eq!(Scale::Signed(-70.0).parts(Some(140.0)), (0.5, [0.25, 0.5]));
        assert_eq!(Scale::Signed(280.0).parts(Some(140.0)), (1.0, [0.5, 1.0]));
        assert_eq!(Scale::FromZero(1.0).parts(None), (0.0, [0.0, 0.0]));
    }

    #[test]
    fn values_and_limits_have_one_unit() {
        let torque = |units| Quantity::Torque.unit(units);
        assert_eq!(Scale::Signed(0.25).text(Some(6.3), torque(Units::Handy)), "+250.0 of 6300 mN·m");
        assert_eq!(Scale::Signed(0.25).text(Some(6.3), torque(Units::Si)), "+0.250 of 6.3 N·m");
        assert_eq!(Scale::FromZero(0.25).text(None, torque(Units::Si)), "0.2 N·m");
    }
}
