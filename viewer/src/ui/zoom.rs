//! Zoom of a trace by the mouse: a box, other values, other times, or the whole trace.

use crate::palette::Palette;
use egui::{PointerButton, Pos2, Rect, Stroke, StrokeKind, Ui, Vec2};
use egui_plot::PlotResponse;

/// Request for another range of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ZoomRequest {
    /// Time range, s, and range of values, in the displayed units.
    Box([f64; 2], [f64; 2]),
    /// Range of values, in the displayed units.
    Values([f64; 2]),
    /// Time range, s.
    Time([f64; 2]),
    /// The whole trace.
    All,
}

/// Effect of the wheel over a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheel {
    /// Zoom the values: all traces are visible.
    Zooms,
    /// Scroll the traces; with Alt, zoom the values.
    Scrolls,
}

/// Zoom factor per point of the wheel.
const ZOOM_PER_POINT: f64 = 1.003;
/// Smallest size of a box, points: below, the range in that direction does not change.
const LEAST_BOX_PT: f32 = 6.0;

/// Returns the zoom requested by the mouse: the right button draws a box, the wheel zooms the values about the pointer unless it scrolls,
/// the wheel with Ctrl zooms the time, the middle button shifts the time, and a double click shows the whole trace again.
pub fn requested<R>(
    ui: &Ui,
    shown: &PlotResponse<R>,
    wheel: Wheel,
    palette: &Palette,
) -> Option<ZoomRequest> {
    let (response, transform) = (&shown.response, &shown.transform);
    if response.double_clicked() {
        return Some(ZoomRequest::All);
    }
    if let Some(request) = boxed(ui, shown, palette) {
        return Some(request);
    }
    let bounds = transform.bounds();
    let (time_s, values) = (bounds.range_x(), bounds.range_y());
    if response.dragged_by(PointerButton::Middle) {
        let per_point = (time_s.end() - time_s.start()) / f64::from(transform.frame().width().max(1.0));
        let shift_s = -f64::from(response.drag_delta().x) * per_point;
        return (shift_s != 0.0)
            .then(|| ZoomRequest::Time([time_s.start() + shift_s, time_s.end() + shift_s]));
    }
    let pointer = response.hover_pos()?;
    let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, f64::from(input.zoom_delta())));
    let about = |at: f64, range: std::ops::RangeInclusive<f64>, factor: f64| {
        [*range.start(), *range.end()].map(|end| at + (end - at) / factor)
    };
    let at = transform.value_from_position(pointer);
    if pinch != 1.0 {
        return Some(ZoomRequest::Time(about(at.x, time_s, pinch)));
    }
    if scroll != 0.0 && (wheel == Wheel::Zooms || ui.input(|input| input.modifiers.alt)) {
        // The surroundings of the traces must not scroll as well.
        ui.input_mut(|input| input.smooth_scroll_delta = Vec2::ZERO);
        return Some(ZoomRequest::Values(about(at.y, values, ZOOM_PER_POINT.powf(f64::from(scroll)))));
    }
    None
}

/// Draws a box with the right button; returns the request when the button is released.
fn boxed<R>(ui: &Ui, shown: &PlotResponse<R>, palette: &Palette) -> Option<ZoomRequest> {
    let (response, transform) = (&shown.response, &shown.transform);
    let id = response.id.with("box");
    if response.drag_started_by(PointerButton::Secondary)
        && let Some(from) = ui.input(|input| input.pointer.press_origin())
    {
        ui.data_mut(|data| data.insert_temp(id, from));
    }
    let from: Pos2 = ui.data(|data| data.get_temp(id))?;
    let to = response.interact_pointer_pos().or_else(|| ui.input(|input| input.pointer.latest_pos()))?;
    let area = Rect::from_two_pos(from, to).intersect(*transform.frame());
    if !response.drag_stopped_by(PointerButton::Secondary) {
        ui.painter().rect_stroke(area, 0.0, Stroke::new(1.0, palette.cursor), StrokeKind::Inside);
        return None;
    }
    ui.data_mut(|data| data.remove_temp::<Pos2>(id));
    let (low, high) =
        (transform.value_from_position(area.left_bottom()), transform.value_from_position(area.right_top()));
    let (time_s, values) = ([low.x, high.x], [low.y, high.y]);
    match (area.width() >= LEAST_BOX_PT, area.height() >= LEAST_BOX_PT) {
        (true, true) => Some(ZoomRequest::Box(time_s, values)),
        (true, false) => Some(ZoomRequest::Time(time_s)),
        (false, true) => Some(ZoomRequest::Values(values)),
        (false, false) => None,
    }
}
