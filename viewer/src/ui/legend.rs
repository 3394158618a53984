//! What the colours of the 3D view mean.

use crate::palette::{Palette, strain_color};
use crate::placing::round_below;
use crate::scene::{ArrowKey, ColorScale, SceneFacts, field_color};
use crate::ui::style::{BODY_PT, SMALL_PT};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, vec2};
use flotor_drawing::camera::Camera;
use flotor_hal::DVec3;

/// Size of the scale of strain, points.
const SCALE: egui::Vec2 = vec2(190.0, 9.0);
const MARGIN: f32 = 22.0;

/// Paints what the colours of bodies and of the arrows mean into the lower left.
pub fn paint(painter: &Painter, area: Rect, facts: &SceneFacts, camera: &Camera, palette: &Palette) {
    let font = FontId::proportional(SMALL_PT);
    let at = area.left_bottom() + vec2(MARGIN, -MARGIN - SCALE.y - SMALL_PT - 4.0);
    if let Some(scale) = facts.scale {
        paint_scale(painter, at, scale, facts.peak_part, palette);
    }

    // In a narrow view they would stand before the body.
    if area.width() < ROOM_FOR_SCALES_PT {
        return;
    }
    let text = |at: Pos2, align: Align2, text: String| {
        painter.text(at, align, text, font.clone(), palette.faint);
    };
    let grid = area.right_bottom() - vec2(4.4 * MARGIN, MARGIN);
    text(grid, Align2::RIGHT_CENTER, format!("grid {} mm", significant_short(1.0e3 * facts.grid_m)));
    let Some(key) = facts.arrows else { return };
    let above = if facts.scale.is_some() { SMALL_PT + 22.0 } else { 0.0 };
    let line = at + vec2(0.0, 0.5 * SCALE.y - above);
    let (length_pt, words) = force_scale(key, camera, area.height());
    painter.line_segment([line, line + vec2(length_pt, 0.0)], Stroke::new(3.0, opaque(palette.force)));
    text(line + vec2(length_pt + 8.0, 0.0), Align2::LEFT_CENTER, words);
    if key.torque_nm > LEAST_TORQUE_NM {
        let line = line - vec2(0.0, SMALL_PT + 8.0);
        painter.circle_stroke(line + vec2(5.0, 0.0), 5.0, Stroke::new(2.5, opaque(palette.torque)));
        let words = format!("torque on the hand, 3/4 turn = {} mN·m", significant(1.0e3 * key.torque_nm));
        text(line + vec2(18.0, 0.0), Align2::LEFT_CENTER, words);
    }
}

/// Narrower, the scales of arrows and ground would stand before the body, points.
const ROOM_FOR_SCALES_PT: f32 = 600.0;
/// A torque that is not above this was never there, N·m.
const LEAST_TORQUE_NM: f64 = 1.0e-5;

/// Scale of the force arrows: length, points, of an arrow for a round number of newtons at the centre of the view, and its label.
fn force_scale(key: ArrowKey, camera: &Camera, height_pt: f32) -> (f32, String) {
    let force_n = round_below(key.full_force_n);
    let length_pt = force_n * key.mm_per_n * camera.pixels_per_mm(f64::from(height_pt));
    #[allow(clippy::cast_possible_truncation)] // points
    let length_pt = length_pt.min(400.0) as f32;
    (length_pt, format!("force on the hand, as long as {} N", significant_short(force_n)))
}

/// A round number without needless zeros.
fn significant_short(number: f64) -> String {
    format!("{}", (number * 1.0e6).round() / 1.0e6)
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
pub fn opaque([r, g, b, _]: flotor_drawing::geometry::Color) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// Paints the axes of the device frame into the lower right: x, y and z in the colours of the traces.
pub fn axes(painter: &Painter, area: Rect, facts: &SceneFacts, camera: &Camera, palette: &Palette) {
    const LENGTH_PT: f64 = 24.0;
    let middle = area.right_bottom() - vec2(2.4 * MARGIN, 2.2 * MARGIN);
    let (right, up) = camera.right_and_up();
    #[allow(clippy::cast_possible_truncation)] // points
    let on_screen = |axis: DVec3| vec2(axis.dot(right) as f32, -axis.dot(up) as f32);
    for ((axis, name), color) in facts.axes.into_iter().zip(["x", "y", "z"]).zip(palette.components) {
        let tip = on_screen(axis * LENGTH_PT);
        painter.line_segment([middle, middle + tip], Stroke::new(2.0, color));
        let at = middle + on_screen(axis * 1.4 * LENGTH_PT);
        painter.text(at, Align2::CENTER_CENTER, name, FontId::proportional(SMALL_PT), color);
    }
}

/// Paints the name of each device before its place on the ground, the chosen one's brighter.
pub fn names<'a>(
    painter: &Painter,
    area: Rect,
    facts: &SceneFacts,
    camera: &Camera,
    (names, chosen): (impl Iterator<Item = &'a str>, usize),
    palette: &Palette,
) {
    if facts.placing.count < 2 {
        return;
    }
    for (device, name) in names.enumerate() {
        let place_m = facts.placing.place_m(device) + DVec3::Z * facts.ground_m;
        let Some([x, y]) = camera.on_screen(place_m * 1.0e3, f64::from(area.width() / area.height())) else {
            continue;
        };
        #[allow(clippy::cast_possible_truncation)] // points
        let [x, y] = [x as f32 * area.width(), y as f32 * area.height() + 16.0];
        // All of it in sight, above the legend.
        let at = area.min + vec2(x, y.min(area.height() - 3.2 * MARGIN));
        let color = if device == chosen { palette.text } else { palette.faint };
        painter.text(at, Align2::CENTER_TOP, name, FontId::proportional(BODY_PT + 1.0), color);
    }
}
