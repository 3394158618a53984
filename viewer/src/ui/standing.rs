//! Limits and faults: how close to the limits the run is, and what has happened in it so far.

use crate::history::Sample;
use crate::palette::Palette;
use crate::tally::Tally;
use crate::ui::style::SMALL_PT;
use egui::{
    Align, CollapsingHeader, CornerRadius, Layout, Rect, RichText, Role, Sense, Ui, WidgetInfo, vec2,
};
use flotor_core::trace::Events;
use flotor_live::WrenchLimits;

/// Shows how much of each limit is used, and a line for everything that has happened.
pub fn standing(ui: &mut Ui, sample: &Sample, limits: &WrenchLimits, tally: &Tally, palette: &Palette) {
    CollapsingHeader::new(RichText::new("Limits and faults").strong()).default_open(true).show(ui, |ui| {
        let force = sample.force_n().to_array();
        let torque = sample.torque_nm().to_array();
        for (name, value, limit) in
            [("Fx", 0), ("Fy", 1), ("Fz", 2)].map(|(n, k)| (n, force[k], limits.force_n[k]))
        {
            bar(ui, name, value, limit, (1.0, "N"), palette);
        }
        for (name, value, limit) in
            [("Mx", 0), ("My", 1), ("Mz", 2)].map(|(n, k)| (n, torque[k], limits.torque_nm[k]))
        {
            bar(ui, name, value, limit, (1.0e3, "mN·m"), palette);
        }
        ui.add_space(4.0);
        let mut none = true;
        for (bit, name) in Events::NAMES.iter().enumerate() {
            let count = tally.counts().get(bit).copied().unwrap_or(0);
            if count > 0 {
                none = false;
                line(ui, &name.replace('_', " "), &format!("{count} ticks"), palette);
            }
        }
        if tally.dropped > 0 {
            none = false;
            line(ui, "not shown", &format!("{} ticks", tally.dropped), palette);
        }
        if none {
            ui.label(RichText::new("Nothing has happened").color(palette.faint));
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
    (per_si, unit): (f64, &str),
    palette: &Palette,
) {
    let text = match limit {
        Some(limit) => format!("{:+.1} of {:.0} {unit}", value * per_si, limit * per_si),
        None => format!("{:+.1} {unit}", value * per_si),
    };
    ui.horizontal(|ui| {
        ui.add_sized(
            vec2(22.0, 14.0),
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
