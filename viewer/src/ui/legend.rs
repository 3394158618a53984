//! What the colours of the 3D view mean.

use crate::palette::{Palette, strain_color};
use crate::scene::{ColorScale, SceneFacts, field_color};
use crate::ui::style::SMALL_PT;
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, vec2};

/// Size of the scale of strain, points.
const SCALE: egui::Vec2 = vec2(190.0, 9.0);
const MARGIN: f32 = 22.0;

/// Paints what the colours of bodies and of the arrows mean into the lower left.
pub fn paint(painter: &Painter, area: Rect, facts: &SceneFacts, palette: &Palette) {
    let font = FontId::proportional(SMALL_PT);
    let at = area.left_bottom() + vec2(MARGIN, -MARGIN - SCALE.y - SMALL_PT - 4.0);
    if let Some(scale) = facts.scale {
        paint_scale(painter, at, scale, facts.peak_part, palette);
    }

    // In a narrow view they would stand before the body.
    if area.width() < 1100.0 {
        return;
    }
    let mut x = at.x + SCALE.x + 34.0;
    for (color, name) in [(palette.force, "force on the hand"), (palette.torque, "torque on the hand")] {
        painter.circle_filled(Pos2::new(x, at.y + 0.5 * SCALE.y), 5.0, opaque(color));
        let shown = painter.text(
            Pos2::new(x + 10.0, at.y + 0.5 * SCALE.y),
            Align2::LEFT_CENTER,
            name,
            font.clone(),
            palette.faint,
        );
        x = shown.right() + 22.0;
    }
}

fn paint_scale(painter: &Painter, at: Pos2, scale: ColorScale, peak_part: f64, palette: &Palette) {
    let font = FontId::proportional(SMALL_PT);
    let (label, [low, high]) = match scale {
        ColorScale::Strain => {
            ("local strain of the coil".to_owned(), ["rest".to_owned(), "turns touch".to_owned()])
        }
        ColorScale::Field(field, most) => {
            let unit = field.unit();
            (field.name().to_owned(), [format!("0 {unit}"), format!("{} {unit}", significant(most))])
        }
    };
    painter.text(at - vec2(0.0, 5.0), Align2::LEFT_BOTTOM, label, font.clone(), palette.faint);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // points
    let steps = SCALE.x as u16;
    for step in 0..steps {
        let part = f64::from(step) / f64::from(steps - 1);
        let color = match scale {
            ColorScale::Strain => strain_color(part),
            ColorScale::Field(..) => field_color(part, palette),
        };
        let column = Rect::from_min_size(at + vec2(f32::from(step), 0.0), vec2(1.5, SCALE.y));
        painter.rect_filled(column, 0.0, opaque(color));
    }
    #[allow(clippy::cast_possible_truncation)] // a part of the scale
    let mark = at + vec2(SCALE.x * peak_part.min(1.0) as f32, 0.0);
    painter.vline(mark.x, (at.y - 3.0)..=(at.y + SCALE.y + 3.0), Stroke::new(2.0, palette.text));
    let below = at + vec2(0.0, SCALE.y + 4.0);
    painter.text(below, Align2::LEFT_TOP, low, font.clone(), palette.faint);
    painter.text(below + vec2(SCALE.x, 0.0), Align2::RIGHT_TOP, high, font, palette.faint);
}

/// A number in three significant digits.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful of digits
fn significant(number: f64) -> String {
    let before = if number > 0.0 { number.log10().floor() as i32 } else { 0 };
    format!("{number:.*}", (2 - before).clamp(0, 9) as usize)
}

/// A colour of the scene as one of the interface.
#[must_use]
pub fn opaque([r, g, b, _]: crate::geometry::Color) -> Color32 {
    Color32::from_rgb(r, g, b)
}
