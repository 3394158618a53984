//! Style of window and pictures: muted colours, wide spacing, numbers in columns.

use crate::palette::{Look, Palette};
use egui::{Color32, Context, FontFamily, FontId, Stroke, TextStyle, Theme};

/// Size of titles, points.
pub const TITLE_PT: f32 = 21.0;
/// Size of readouts and labels, points.
pub const BODY_PT: f32 = 13.5;
/// Size of axes and remarks, points.
pub const SMALL_PT: f32 = 11.5;

/// Applies the colours and text sizes of a colour scheme to the interface.
pub fn apply(context: &Context, look: Look) {
    let palette = Palette::of(look);
    let theme = match look {
        Look::Dark => Theme::Dark,
        Look::Light => Theme::Light,
    };
    context.set_theme(theme);
    context.style_mut_of(theme, |style| {
        style.text_styles = [
            (TextStyle::Heading, FontId::new(TITLE_PT, FontFamily::Proportional)),
            (TextStyle::Body, FontId::new(BODY_PT, FontFamily::Proportional)),
            (TextStyle::Button, FontId::new(BODY_PT, FontFamily::Proportional)),
            (TextStyle::Monospace, FontId::new(BODY_PT - 0.5, FontFamily::Monospace)),
            (TextStyle::Small, FontId::new(SMALL_PT, FontFamily::Proportional)),
        ]
        .into();
        let visuals = &mut style.visuals;
        visuals.panel_fill = palette.panel;
        visuals.window_fill = palette.panel;
        visuals.extreme_bg_color = palette.panel;
        visuals.override_text_color = Some(palette.text);
        visuals.weak_text_color = Some(palette.faint);
        visuals.warn_fg_color = palette.warning;
        // Opaque: nothing is painted beneath the seam between panels.
        let seam = palette.panel.lerp_to_gamma(palette.grid, 0.6);
        visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, seam);
        visuals.text_edit_bg_color = Some(palette.panel.lerp_to_gamma(palette.grid, 0.3));
        visuals.selection.bg_fill = Color32::from_rgb(0, 114, 178);
        style.spacing.item_spacing = egui::vec2(8.0, 6.0);
    });
}

/// Shows a button with a symbol, without a frame; `help` is its hover text and accessible name.
pub fn quiet(ui: &mut egui::Ui, sign: &str, help: &str) -> egui::Response {
    let button =
        ui.add(egui::Button::new(egui::RichText::new(sign).size(15.0)).frame(false)).on_hover_text(help);
    button.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, help));
    button
}
