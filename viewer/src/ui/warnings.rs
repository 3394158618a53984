//! What a person should know now, and what to do about it.

use crate::palette::Palette;
use crate::ui::style::BODY_PT;
use egui::{CornerRadius, Frame, Margin, Rect, RichText, Stroke, Ui, UiBuilder, vec2};

/// Shows that something was done, in the lower left of an area.
pub fn done(ui: &mut Ui, area: Rect, text: &str, palette: &Palette) {
    let height = BODY_PT + 26.0;
    let inside = Rect::from_min_max(area.left_bottom() + vec2(16.0, -height), area.max);
    let mut ui = ui.new_child(UiBuilder::new().max_rect(inside).id_salt("done"));
    Frame::new()
        .fill(palette.panel.gamma_multiply(0.88))
        .stroke(Stroke::new(1.0, palette.well))
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::symmetric(10, 5))
        .show(&mut ui, |ui| ui.label(RichText::new(text).size(BODY_PT).color(palette.text)));
}

/// Shows warnings as chips in the upper left of an area, most urgent first.
pub fn warnings(ui: &mut Ui, area: Rect, warnings: &[String], palette: &Palette) {
    /// Distance from the corner, points.
    const MARGIN: f32 = 16.0;
    if warnings.is_empty() {
        return;
    }
    let inside = Rect::from_min_max(area.min + vec2(MARGIN, MARGIN), area.max);
    let mut ui = ui.new_child(UiBuilder::new().max_rect(inside).id_salt("warnings"));
    for warning in warnings {
        Frame::new()
            .fill(palette.panel.gamma_multiply(0.88))
            .stroke(Stroke::new(1.0, palette.warning))
            .corner_radius(CornerRadius::same(6))
            .inner_margin(Margin::symmetric(10, 5))
            .show(&mut ui, |ui| {
                ui.label(RichText::new(format!("⚠ {warning}")).size(BODY_PT).color(palette.warning));
            });
    }
}
