//! Geometry of a picture: rectangles in pixels, and the projection of a panel's coordinates to pixels.

use super::axis::Domain;
use super::decimate::Point;

/// Largest distance of coordinates from the plotting area, in sizes of the area. Points farther outside are moved to this distance:
/// only the direction of the line that leaves matters.
const FARTHEST_FRACTION: f64 = 1000.0;

/// Axis-aligned rectangle in pixels, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Returns the x at a fraction of the width, from the left.
    pub(super) fn x_at(&self, fraction: f64) -> f64 {
        self.left + self.width * fraction
    }

    /// Returns the y at a fraction of the height, from the bottom.
    pub(super) fn y_at(&self, fraction: f64) -> f64 {
        self.bottom() - self.height * fraction
    }

    /// Returns the rectangle enlarged by `by_px` on all sides.
    pub(super) fn grown(&self, by_px: f64) -> Self {
        let Self { left, top, width, height } = self;
        Self {
            left: left - by_px,
            top: top - by_px,
            width: width + 2.0 * by_px,
            height: height + 2.0 * by_px,
        }
    }

    /// Returns true if the point lies in the rectangle or on its edge.
    pub(super) fn contains(&self, point: Point) -> bool {
        self.nearest(point) == point
    }

    /// Returns the point of the rectangle nearest to `point`.
    pub(super) fn nearest(&self, (x, y): Point) -> Point {
        (x.clamp(self.left, self.right()), y.clamp(self.top, self.bottom()))
    }

    /// Returns a line from bottom to top at `x`.
    pub(super) fn upright(&self, x: f64) -> [Point; 2] {
        [(x, self.bottom()), (x, self.top)]
    }

    /// Returns a line from left to right at `y`.
    pub(super) fn level(&self, y: f64) -> [Point; 2] {
        [(self.left, y), (self.right(), y)]
    }
}

/// Projection from scale coordinates to pixels of one panel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projection {
    pub(super) x: Domain,
    pub(super) y: Domain,
    pub(super) frame: Rect,
}

impl Projection {
    pub(super) fn x_px(&self, coordinate: f64) -> f64 {
        self.frame.x_at(bounded(self.x.fraction(coordinate)))
    }

    pub(super) fn y_px(&self, coordinate: f64) -> f64 {
        self.frame.y_at(bounded(self.y.fraction(coordinate)))
    }

    pub(super) fn point_px(&self, (x, y): Point) -> Point {
        (self.x_px(x), self.y_px(y))
    }

    pub(super) fn point(&self, (x, y): (f64, f64)) -> Option<Point> {
        self.x.scale.forward(x).zip(self.y.scale.forward(y))
    }

    /// Returns the width of one pixel column in x coordinates.
    pub(super) fn column(&self) -> f64 {
        self.x.span() / self.frame.width
    }
}

fn bounded(fraction: f64) -> f64 {
    fraction.clamp(-FARTHEST_FRACTION, FARTHEST_FRACTION)
}
