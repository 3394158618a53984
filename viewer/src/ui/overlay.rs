//! Layout of texts over the 3D view: one pass, in order of priority.
//!
//! Every part reserves its rectangle in the same [`Overlay`], in a corner or below a point. The order of the calls is the priority: a
//! later part is placed beside the earlier rectangles, and is left out without room. No text covers another text. The order is:
//!
//! 1. in a picture, title and warnings ([`crate::ui::readout`]); a window has the bar and the row of messages for them,
//! 2. the clock and the rows of numbers ([`crate::ui::readout::numbers`]): a new number is one more
//!    [`crate::ui::readout::NumberRow`] at the end of the rows,
//! 3. scales and axes ([`crate::ui::legend`]),
//! 4. names of devices ([`crate::ui::legend::names`]) and buttons.

use egui::text::{LayoutJob, TextWrapping};
use egui::{Color32, FontId, Galley, Painter, Pos2, Rect, Vec2, pos2};
use std::sync::Arc;

/// Distance of texts from the edges of the view, points.
pub const MARGIN_PT: f32 = 16.0;
/// Distance between two rectangles, points.
pub const GAP_PT: f32 = 4.0;
/// Overlap below which two rectangles count as disjoint, points: the rounding of sums.
const ROUNDING_PT: f32 = 1.0e-2;

/// Corner of the view. Rectangles at the top are stacked downwards, rectangles at the bottom upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corner {
    /// Upper left.
    LeftTop,
    /// Upper right.
    RightTop,
    /// Lower left.
    LeftBottom,
    /// Lower right.
    RightBottom,
}

impl Corner {
    const fn is_left(self) -> bool {
        matches!(self, Self::LeftTop | Self::LeftBottom)
    }

    const fn is_top(self) -> bool {
        matches!(self, Self::LeftTop | Self::RightTop)
    }
}

/// Area over the view, and the rectangles reserved so far.
pub struct Overlay {
    painter: Painter,
    inside: Rect,
    taken: Vec<Rect>,
}

impl Overlay {
    /// Creates an overlay of an area, without reserved rectangles.
    #[must_use]
    pub fn new(painter: &Painter, area: Rect) -> Self {
        Self { painter: painter.with_clip_rect(area), inside: area.shrink(MARGIN_PT), taken: Vec::new() }
    }

    /// Returns the painter of the area.
    #[must_use]
    pub fn painter(&self) -> &Painter {
        &self.painter
    }

    /// Returns the area within its margin, points.
    #[must_use]
    pub fn inside(&self) -> Rect {
        self.inside
    }

    /// Reserves a rectangle in a corner, above or below the earlier rectangles; `None` without room.
    pub fn take(&mut self, corner: Corner, size: Vec2) -> Option<Rect> {
        let left = if corner.is_left() { self.inside.left() } else { self.inside.right() - size.x };
        let mut top = if corner.is_top() { self.inside.top() } else { self.inside.bottom() - size.y };
        loop {
            let rect = Rect::from_min_size(pos2(left, top), size);
            let Some(before) = self.obstacle(rect) else { return self.keep(rect) };
            top = if corner.is_top() { before.bottom() + GAP_PT } else { before.top() - GAP_PT - size.y };
        }
    }

    /// Reserves a rectangle centred below a point, moved into the area if necessary; `None` if the rectangle overlaps an earlier
    /// rectangle or does not fit into the area.
    pub fn take_below(&mut self, point: Pos2, size: Vec2) -> Option<Rect> {
        let most = (self.inside.right() - size.x).max(self.inside.left());
        let left = (point.x - 0.5 * size.x).clamp(self.inside.left(), most);
        let top = point.y.min(self.inside.bottom() - size.y);
        let rect = Rect::from_min_size(pos2(left, top), size);
        if self.obstacle(rect).is_none() { self.keep(rect) } else { None }
    }

    fn obstacle(&self, rect: Rect) -> Option<Rect> {
        self.taken.iter().copied().find(|taken| overlap(taken.expand(GAP_PT), rect))
    }

    fn keep(&mut self, rect: Rect) -> Option<Rect> {
        let has_room = self.inside.expand(ROUNDING_PT).contains_rect(rect);
        has_room.then(|| {
            self.taken.push(rect);
            rect
        })
    }
}

fn overlap(a: Rect, b: Rect) -> bool {
    let both = a.intersect(b);
    both.width() > ROUNDING_PT && both.height() > ROUNDING_PT
}

/// Lays out one line of text, shortened with "…" beyond a width, points.
#[must_use]
pub fn shortened(painter: &Painter, text: &str, font: FontId, color: Color32, most_pt: f32) -> Arc<Galley> {
    let mut job = LayoutJob::simple_singleline(text.to_owned(), font, color);
    job.wrap = TextWrapping::truncate_at_width(most_pt.max(0.0));
    painter.layout_job(job)
}

/// Returns the width of one line of text, points.
#[must_use]
pub fn width_pt(painter: &Painter, text: &str, font: FontId) -> f32 {
    painter.layout_no_wrap(text.to_owned(), font, Color32::PLACEHOLDER).size().x
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Context, LayerId, vec2};

    /// Overlay of 400 x 120 points without anything on it.
    fn overlay() -> Overlay {
        let area = Rect::from_min_size(Pos2::ZERO, vec2(400.0, 120.0));
        Overlay::new(&Painter::new(Context::default(), LayerId::background(), area), area)
    }

    #[test]
    fn rectangles_are_disjoint_inside_and_in_order_of_priority() {
        let mut overlay = overlay();
        let mut taken = Vec::new();
        for _ in 0..20 {
            for corner in [Corner::LeftTop, Corner::RightTop, Corner::RightBottom, Corner::LeftBottom] {
                taken.extend(overlay.take(corner, vec2(150.0, 20.0)));
            }
            taken.extend(overlay.take_below(pos2(200.0, 50.0), vec2(60.0, 16.0)));
        }
        assert_eq!(taken.len(), 7, "three lines at the left, three at the right, one between: {taken:?}");
        for (index, rect) in taken.iter().enumerate() {
            assert!(overlay.inside().expand(ROUNDING_PT).contains_rect(*rect), "{rect:?}");
            assert!(taken[..index].iter().all(|before| !overlap(*before, *rect)), "{rect:?} in {taken:?}");
        }
        assert!(overlay.take(Corner::LeftTop, vec2(500.0, 10.0)).is_none(), "wider than the view");
    }
}
