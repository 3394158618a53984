//! Row of messages beneath the bar: a separate place for warnings, which cover nothing.
//!
//! The row is always shown, so that a message does not move other parts. It shows the warnings, the most urgent first; without
//! warnings, the last action or the subtitle of the run. After the end of a run, the row grows to show the whole reason.

use crate::palette::Palette;
use crate::ui::overlay::{shortened, width_pt};
use crate::ui::style::{BODY_PT, SMALL_PT};
use egui::text::LayoutJob;
use egui::{
    Align, Color32, CornerRadius, FontId, Galley, Label, Layout, RichText, Role, Sense, Stroke, StrokeKind,
    Ui, WidgetInfo, vec2,
};
use std::sync::Arc;

/// Height of the row, points.
pub const ROW_PT: f32 = 26.0;
/// Height of the chip of a warning, points.
const CHIP_PT: f32 = 22.0;
/// Distance of a text from the border of its chip, and between two chips, points.
const PADDING_PT: f32 = 8.0;
const GAP_PT: f32 = 8.0;
/// Distance between the lines of a row of several lines, points.
const LINE_GAP_PT: f32 = 4.0;

/// Height of the row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// One line, for a running session.
    Line,
    /// As many lines as the messages need, up to a height, points.
    Lines {
        /// Largest height, points.
        most_pt: f32,
    },
}

/// Current messages.
pub struct Messages<'a> {
    /// Warnings, the most urgent first.
    pub warnings: &'a [String],
    /// Text shown without warnings.
    pub otherwise: &'a str,
    /// Height of the row.
    pub extent: Extent,
}

impl Messages<'_> {
    /// Returns the height of the row within a width, points.
    #[must_use]
    pub fn height_pt(&self, ui: &Ui, width_pt: f32) -> f32 {
        match (self.extent, self.warnings) {
            (Extent::Lines { most_pt }, [first, rest @ ..]) => {
                let rest_pt = if rest.is_empty() { 0.0 } else { ROW_PT };
                let first_pt = in_full(ui, first, [width_pt, most_pt], Color32::PLACEHOLDER).size().y;
                (first_pt + LINE_GAP_PT).max(ROW_PT) + rest_pt
            }
            _ => ROW_PT,
        }
    }

    /// Shows the row of messages; replaces the warnings that do not fit with their count.
    pub fn show(&self, ui: &mut Ui, palette: &Palette) {
        match (self.extent, self.warnings) {
            (_, []) => {
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text = RichText::new(self.otherwise).size(SMALL_PT).color(palette.faint);
                    ui.add(Label::new(text).truncate());
                });
            }
            (Extent::Lines { most_pt }, [first, rest @ ..]) => {
                ui.spacing_mut().item_spacing.y = 0.0;
                let galley = in_full(ui, first, [ui.available_width(), most_pt], palette.warning);
                ui.label(galley).on_hover_text(first);
                if !rest.is_empty() {
                    line(ui, rest, palette);
                }
            }
            (Extent::Line, warnings) => line(ui, warnings, palette),
        }
    }
}

/// Lays out a warning in as many lines as necessary within a width and a height, points, shortened beyond them.
fn in_full(ui: &Ui, warning: &String, [width_pt, most_pt]: [f32; 2], color: Color32) -> Arc<Galley> {
    let mut job = LayoutJob::simple(with_sign(warning), FontId::proportional(BODY_PT), color, width_pt);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful of lines
    let rows = (most_pt / (BODY_PT + LINE_GAP_PT)) as usize;
    job.wrap.max_rows = rows.max(1);
    ui.painter().layout_job(job)
}

/// Shows as many warnings as fit into one line, and the number of the others. The first warning is shortened rather than left out.
fn line(ui: &mut Ui, warnings: &[String], palette: &Palette) {
    let font = FontId::proportional(BODY_PT);
    let more_pt = width_pt(ui.painter(), "+00 more", font.clone()) + GAP_PT;
    let mut room_pt = ui.available_width();
    let mut shown: Vec<(&String, f32)> = Vec::new();
    for (index, warning) in warnings.iter().enumerate() {
        let reserved_pt = if index + 1 < warnings.len() { more_pt } else { 0.0 };
        let text_pt = width_pt(ui.painter(), &with_sign(warning), font.clone());
        let most_pt = room_pt - reserved_pt - 2.0 * PADDING_PT;
        if index > 0 && text_pt > most_pt {
            break;
        }
        let text_pt = text_pt.min(most_pt);
        shown.push((warning, text_pt));
        room_pt -= text_pt + 2.0 * PADDING_PT + GAP_PT;
    }
    let rest = &warnings[shown.len()..];
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        ui.spacing_mut().item_spacing.x = GAP_PT;
        shown.into_iter().for_each(|(warning, text_pt)| chip(ui, warning, text_pt, palette));
        if !rest.is_empty() {
            let count = RichText::new(format!("+{} more", rest.len())).size(BODY_PT).color(palette.warning);
            let response = ui.label(count).on_hover_text(rest.join("\n"));
            let all: Vec<String> = rest.iter().map(with_sign).collect();
            response.widget_info(|| WidgetInfo::labeled(Role::Label, true, all.join("; ")));
        }
    });
}

fn chip(ui: &mut Ui, warning: &String, text_pt: f32, palette: &Palette) {
    let font = FontId::proportional(BODY_PT);
    // Slightly more than measured, so that a text that fits is not shortened.
    let galley = shortened(ui.painter(), &with_sign(warning), font, palette.warning, text_pt + 0.5);
    let (area, response) = ui.allocate_exact_size(vec2(text_pt + 2.0 * PADDING_PT, CHIP_PT), Sense::hover());
    let stroke = Stroke::new(1.0, palette.warning);
    ui.painter().rect_stroke(area, CornerRadius::same(6), stroke, StrokeKind::Inside);
    let at = area.center() - 0.5 * galley.size();
    ui.painter().galley(at, galley, palette.warning);
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, with_sign(warning)));
    response.on_hover_text(warning);
}

fn with_sign(warning: &String) -> String {
    format!("⚠ {warning}")
}
