//! Handle in the 3D view, draggable if the hand can be guided.

use crate::guide::Guide;
use crate::palette::Palette;
use crate::ui::legend::opaque;
use crate::ui::style::BODY_PT;
use egui::{Align2, CursorIcon, FontId, Key, Pos2, Rect, Role, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};
use flotor_drawing::camera::Camera;
use flotor_drawing::drag::{DragPlane, Ray};
use flotor_hal::DVec3;

/// Accessible name of the handle, with the ways to move it.
pub const DRAG: &str = "Drag the handle; the wheel, Q and E change its depth, Shift is ten times finer";
/// Hint over the view while no handle is dragged.
pub const HINT: &str = "Drag the handle; wheel, Q, E for its depth, Shift for fine motion";
/// Radius around the handle in which a drag can start, points.
const REACH_PT: f32 = 22.0;
/// Motion away from the eye per point of the wheel and per press of a key, mm.
const DEPTH_MM_PER_POINT: f64 = 0.02;
const DEPTH_MM_PER_KEY: f64 = 0.1;
/// Factor on the motion of the pointer in fine motion.
const FINE: f64 = 0.1;

/// Handle at one time.
#[derive(Clone, Copy, Debug)]
pub struct Handle {
    /// Number of the device.
    pub device: usize,
    /// Position in the device frame, m.
    pub position_m: DVec3,
    /// Position in the scene, mm.
    pub scene_mm: DVec3,
    /// Magnitude of the force on the hand, N.
    pub force_n: f64,
}

/// Current drag: its plane, and the last position of the pointer.
#[derive(Clone, Copy, Debug)]
pub struct Drag {
    plane: DragPlane,
    pointer: Pos2,
}

/// Shows a draggable handle. A drag starts to guide the hand, and moves the guide's target with the pointer. `to_device` converts a
/// displacement in the scene, m, to the device frame.
pub fn handle(
    ui: &Ui,
    (area, camera): (Rect, &Camera),
    handle: &Handle,
    (guide, drag): (&mut Guide, &mut Option<Drag>),
    to_device: impl Fn(DVec3) -> DVec3,
    palette: &Palette,
) {
    let aspect = f64::from(area.width() / area.height().max(1.0));
    let Some(place) = camera.on_screen(handle.scene_mm, aspect) else { return };
    #[allow(clippy::cast_possible_truncation)] // points
    let place = area.min + area.size() * vec2(place[0] as f32, place[1] as f32);
    let reach = Rect::from_center_size(place, vec2(2.0 * REACH_PT, 2.0 * REACH_PT)).intersect(area);
    let response = ui.interact(reach, ui.scope_id().with(("handle", handle.device)), Sense::drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, DRAG));
    let pointer = response.interact_pointer_pos();
    if let Some(pointer) = pointer.filter(|_| response.drag_started()) {
        guide.take(handle.device, handle.position_m);
        *drag = Some(Drag { plane: DragPlane::facing(camera, handle.scene_mm), pointer });
    }
    let is_held = guide.held() == Some(handle.device);
    match (pointer, drag.as_mut()) {
        (Some(pointer), Some(drag)) if is_held && response.dragged() => {
            let ray = |at: Pos2| {
                let part = (at - area.min) / area.size();
                Ray::through(camera, [f64::from(part.x), f64::from(part.y)], aspect)
            };
            let (depth_mm, share) = depth_and_share(ui);
            let way_mm = drag.plane.moved_mm([&ray(drag.pointer), &ray(pointer)], depth_mm) * share;
            drag.pointer = pointer;
            guide.move_by(to_device(way_mm * 1.0e-3));
            let number = format!("{:.2} N", handle.force_n);
            let at = pos2(place.x + REACH_PT + 6.0, place.y);
            let color = opaque(palette.force);
            ui.painter().text(at, Align2::LEFT_CENTER, number, FontId::monospace(BODY_PT + 2.0), color);
        }
        _ => *drag = None,
    }
    let color = if is_held { palette.text } else { palette.faint };
    ui.painter().circle_stroke(
        place,
        REACH_PT,
        Stroke::new(if response.hovered() { 2.0 } else { 1.0 }, color),
    );
    let cursor = if is_held { CursorIcon::Grabbing } else { CursorIcon::Grab };
    let response = response.on_hover_cursor(cursor);
    if !is_held {
        response.on_hover_text(DRAG);
    }
}

/// Returns the motion of the target away from the eye by wheel and keys, mm, and the factor on all motions.
fn depth_and_share(ui: &Ui) -> (f64, f64) {
    ui.input(|input| {
        let pressed = |key: Key| f64::from(u8::from(input.key_pressed(key)));
        let keys = pressed(Key::E) - pressed(Key::Q);
        // With Shift, some systems turn the wheel sideways.
        let wheel = input.smooth_scroll_delta();
        let depth_mm = f64::from(wheel.x + wheel.y) * DEPTH_MM_PER_POINT + keys * DEPTH_MM_PER_KEY;
        (depth_mm, if input.modifiers.shift { FINE } else { 1.0 })
    })
}
