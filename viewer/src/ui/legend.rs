//! Legend of the 3D view: colours, arrows, grid, axes, and names of devices.

use crate::palette::{Palette, strain_color};
use crate::scene::{ArrowKey, ColorScale, SceneFacts, field_color};
use crate::ui::overlay::{Corner, Overlay, shortened, width_pt};
use crate::ui::style::{BODY_PT, SMALL_PT};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, vec2};
use flotor_drawing::camera::Camera;
use flotor_drawing::placing::round_below;
use flotor_hal::DVec3;

/// Size of the colour scale, and height of a line of text, points.
const SCALE: egui::Vec2 = vec2(190.0, 9.0);
const LINE_PT: f32 = SMALL_PT + 4.0;
/// Smallest width of a view with scales of arrows and ground, points: in a narrower view they would cover the body.
const ROOM_FOR_SCALES_PT: f32 = 600.0;
/// Largest length of the arrow of the scale, as a fraction of the width of the view.
const MOST_OF_WIDTH: f64 = 0.3;
/// Scale of torque arrows above which the legend shows the scale, N·m.
const LEAST_TORQUE_NM: f64 = 1.0e-5;

/// Paints the legend of the colours of bodies, of the arrows and of a contact into the lower left, and the distance between the grid
/// lines into the lower right.
pub fn paint(overlay: &mut Overlay, area: Rect, facts: &SceneFacts, camera: &Camera, palette: &Palette) {
    if let Some(scale) = facts.scale
        && let Some(rect) = overlay.take(Corner::LeftBottom, SCALE + vec2(0.0, 2.0 * LINE_PT))
    {
        paint_scale(overlay.painter(), rect.left_top() + vec2(0.0, LINE_PT), scale, facts.peak_part, palette);
    }
    // In a narrow view the scales would cover the body.
    if area.width() < ROOM_FOR_SCALES_PT {
        return;
    }
    sign(
        overlay,
        Corner::RightBottom,
        &format!("grid {} mm", significant_short(1.0e3 * facts.grid_m)),
        0.0,
        palette,
    );
    let Some(key) = facts.arrows else { return };
    let (length_pt, words) = force_scale(key, camera, area);
    if let Some(line) = sign(overlay, Corner::LeftBottom, &words, length_pt + 8.0, palette) {
        let end = line + vec2(length_pt, 0.0);
        overlay.painter().line_segment([line, end], Stroke::new(3.0, opaque(palette.force)));
    }
    if key.torque_nm > LEAST_TORQUE_NM {
        let words = format!("torque on the hand, 3/4 turn = {} mN·m", significant(1.0e3 * key.torque_nm));
        if let Some(line) = sign(overlay, Corner::LeftBottom, &words, 18.0, palette) {
            let stroke = Stroke::new(2.5, opaque(palette.torque));
            overlay.painter().circle_stroke(line + vec2(5.0, 0.0), 5.0, stroke);
        }
    }
    if let Some(depth_m) = facts.contact_depth_m {
        let words = format!("point of contact and normal, depth {:.3} mm", 1.0e3 * depth_m);
        if let Some(line) = sign(overlay, Corner::LeftBottom, &words, 18.0, palette) {
            overlay.painter().circle_filled(line + vec2(5.0, 0.0), 4.0, opaque(palette.contact));
        }
    }
}

/// Paints a line of text with room for a symbol of this width before it; returns the left end of the symbol, `None` without room.
fn sign(overlay: &mut Overlay, corner: Corner, words: &str, sign_pt: f32, palette: &Palette) -> Option<Pos2> {
    let font = FontId::proportional(SMALL_PT);
    let size = vec2(sign_pt + width_pt(overlay.painter(), words, font.clone()), LINE_PT);
    let rect = overlay.take(corner, size)?;
    let at = rect.left_center() + vec2(sign_pt, 0.0);
    overlay.painter().text(at, Align2::LEFT_CENTER, words, font, palette.faint);
    Some(rect.left_center())
}

/// Returns the length, points, of an arrow for a round number of newtons at the centre of the view, and its label.
fn force_scale(key: ArrowKey, camera: &Camera, area: Rect) -> (f32, String) {
    let per_n = key.mm_per_n * camera.pixels_per_mm(f64::from(area.height()));
    let force_n = round_below(key.full_force_n.min(MOST_OF_WIDTH * f64::from(area.width()) / per_n));
    #[allow(clippy::cast_possible_truncation)] // points
    let length_pt = (force_n * per_n) as f32;
    (length_pt, format!("force on the hand, this length is {} N", significant_short(force_n)))
}

/// Formats a round number without trailing zeros.
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
    painter.text(at - vec2(0.0, 3.0), Align2::LEFT_BOTTOM, label, font.clone(), palette.faint);
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
    let below = at + vec2(0.0, SCALE.y + 3.0);
    painter.text(below, Align2::LEFT_TOP, low, font.clone(), palette.faint);
    painter.text(below + vec2(SCALE.x, 0.0), Align2::RIGHT_TOP, high, font, palette.faint);
}

/// Formats a number with three significant digits.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a handful of digits
fn significant(number: f64) -> String {
    let before = if number > 0.0 { number.log10().floor() as i32 } else { 0 };
    format!("{number:.*}", (2 - before).clamp(0, 9) as usize)
}

/// Converts a colour of the scene to an opaque colour of the interface.
#[must_use]
pub fn opaque([r, g, b, _]: flotor_drawing::geometry::Color) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// Paints the axes of the device frame into the lower right: x, y and z in the colours of the traces.
pub fn axes(overlay: &mut Overlay, facts: &SceneFacts, camera: &Camera, palette: &Palette) {
    const LENGTH_PT: f64 = 24.0;
    const SIZE_PT: f32 = 82.0;
    let Some(rect) = overlay.take(Corner::RightBottom, vec2(SIZE_PT, SIZE_PT)) else { return };
    let (painter, middle) = (overlay.painter(), rect.center());
    let (right, up) = camera.right_and_up();
    #[allow(clippy::cast_possible_truncation)] // points
    let on_screen = |axis: DVec3| vec2(axis.dot(right) as f32, -axis.dot(up) as f32);
    let mut letters: Vec<Rect> = Vec::new();
    for ((axis, name), color) in facts.axes.into_iter().zip(["x", "y", "z"]).zip(palette.components) {
        let tip = on_screen(axis * LENGTH_PT);
        painter.line_segment([middle, middle + tip], Stroke::new(2.0, color));
        let at = middle + on_screen(axis * 1.4 * LENGTH_PT);
        let letter = Rect::from_center_size(at, vec2(SMALL_PT, SMALL_PT));
        // Of two overlapping axes, only the first has its letter.
        if letters.iter().all(|before| !before.intersects(letter)) {
            painter.text(at, Align2::CENTER_CENTER, name, FontId::proportional(SMALL_PT), color);
            letters.push(letter);
        }
    }
}

/// Paints the name of each device below the device, shortened to the distance of the next device, with more contrast for the chosen
/// device; paints nothing for a single device.
pub fn names<'a>(
    overlay: &mut Overlay,
    area: Rect,
    facts: &SceneFacts,
    camera: &Camera,
    (names, chosen): (impl Iterator<Item = &'a str>, usize),
    palette: &Palette,
) {
    /// Distance of a name from the lower end of its device, and between two names, points.
    const BELOW_PT: f32 = 12.0;
    const BETWEEN_PT: f32 = 12.0;
    /// Smallest width of a readable name, points.
    const LEAST_PT: f32 = 24.0;
    if facts.placing.count < 2 {
        return;
    }
    let aspect = f64::from(area.width() / area.height());
    let place = |device: usize| {
        let place_m = facts.placing.place_m(device) + DVec3::Z * facts.foot_m;
        let [x, y] = camera.on_screen(place_m * 1.0e3, aspect)?;
        #[allow(clippy::cast_possible_truncation)] // points
        let at = area.min + vec2(x as f32 * area.width(), y as f32 * area.height());
        area.contains(at).then_some(at + vec2(0.0, BELOW_PT))
    };
    let places: Vec<Option<Pos2>> = (0..facts.placing.count).map(place).collect();
    let distances = places.iter().zip(places.iter().skip(1));
    let distances = distances.filter_map(|(one, next)| Some(((*one)?.x - (*next)?.x).abs()));
    let most_pt = distances.fold(area.width(), f32::min) - BETWEEN_PT;
    for (device, name) in names.enumerate() {
        let Some(at) = places.get(device).copied().flatten().filter(|_| most_pt >= LEAST_PT) else {
            continue;
        };
        let color = if device == chosen { palette.text } else { palette.faint };
        let font = FontId::proportional(BODY_PT + 1.0);
        let galley = shortened(overlay.painter(), name, font, color, most_pt);
        if let Some(rect) = overlay.take_below(at, galley.size()) {
            overlay.painter().galley(rect.min, galley, color);
        }
    }
}
