//! How close to the limits the run is, and what has happened in it so far.

use crate::history::Sample;
use crate::palette::Palette;
use crate::quantity::{Quantity, Units};
use crate::tally::Tally;
use crate::ui::style::SMALL_PT;
use egui::{
    Align, CollapsingHeader, CornerRadius, Layout, Rect, RichText, Role, Sense, Ui, WidgetInfo, vec2,
};
use flotor_core::trace::Events;
use flotor_live::WrenchLimits;

/// Shows how much of each limit is used.
pub fn limits(ui: &mut Ui, sample: &Sample, limits: &WrenchLimits, palette: &Palette) {
    CollapsingHeader::new(RichText::new("Limits").strong()).default_open(true).show(ui, |ui| {
        let of_force = (Quantity::Force, limits.force_n, limits.force_norm_n);
        let of_torque = (Quantity::Torque, limits.torque_nm, limits.torque_norm_nm);
        for (quantity, axes, norm) in [of_force, of_torque] {
            let unit = quantity.unit(Units::Handy);
            let mut squares = 0.0;
            for (component, name) in quantity.components().iter().enumerate() {
                let value = quantity.value(sample, component);
                squares += value * value;
                bar(ui, name, value, axes[component], unit, palette);
            }
            bar(ui, "norm", squares.sqrt(), norm, unit, palette);
        }
    });
}

/// Shows a line for everything that has happened. A new line moves what is beneath it: nothing that a pointer may be on.
pub fn events(ui: &mut Ui, tally: &Tally, palette: &Palette) {
    CollapsingHeader::new(RichText::new("Events").strong()).default_open(true).show(ui, |ui| {
        let events =
            Events::NAMES.iter().map(|name| name.replace('_', " ")).zip(tally.counts().iter().copied());
        let counts = events.chain([("not shown".to_owned(), tally.dropped)]);
        let happened: Vec<_> = counts.filter(|(_, count)| *count > 0).collect();
        if happened.is_empty() {
            ui.label(RichText::new("Nothing has happened").color(palette.faint));
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

/// A value between its limits, as a bar from the middle.
fn bar(
    ui: &mut Ui,
    name: &str,
    value: f64,
    limit: Option<f64>,
    (unit, per_si): (&str, f64),
    palette: &Palette,
) {
    let text = match limit {
        Some(limit) => format!("{:+.1} of {:.0} {unit}", value * per_si, limit * per_si),
        None => format!("{:+.1} {unit}", value * per_si),
    };
    ui.horizontal(|ui| {
        ui.add_sized(
            vec2(30.0, 14.0),
            egui::Label::new(RichText::new(name).size(SMALL_PT).color(palette.faint)),
        );
        let width = (ui.available_width() - 112.0).max(20.0);
        let (area, response) = ui.allocate_exact_size(vec2(width, 8.0), Sense::hover());
        let label = format!("{name} {text}");
        response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, &label));
        let painter = ui.painter();
        painter.rect_filled(area, CornerRadius::same(3), palette.grid.gamma_multiply(0.5));
        #[allow(clippy::cast_possible_truncation)] // a part of a bar
        let part = limit.map_or(0.0, |limit| (value / limit).clamp(-1.0, 1.0)) as f32;
        let middle = area.center().x;
        let end = middle + 0.5 * part * area.width();
        let filled = Rect::from_x_y_ranges(middle.min(end)..=middle.max(end), area.y_range());
        let color = if part.abs() > 0.9 { palette.warning } else { palette.components[2] };
        painter.rect_filled(filled, CornerRadius::same(2), color);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(text).size(SMALL_PT));
        });
    });
}
