//! Regions of vectors (forces, torques, velocities) that limits allow: the intersection of a ball and a box.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::limits::Bound;
use flotor_hal::DVec3;

/// Intersection of a ball and a box, both around zero, in the unit of their bound. Convex.
#[derive(Clone, Debug)]
pub struct Region {
    bound: Bound,
    /// Half the sides of the box.
    half_sides: DVec3,
    radius: f64,
    /// Square of the radius, finite.
    radius_squared: f64,
    /// Square of the radius of a ball inside both the ball and the box, with a margin for rounding; 0 if an axis of the
    /// box has no extent.
    inner_squared: f64,
}

/// Radius of a ball without bound, so that its square is finite: every vector in a region is finite.
const ENDLESS: f64 = 1.0e150;

/// Factor that brings a vector scaled to the radius into the ball, in spite of rounding.
const SURELY_INSIDE: f64 = 1.0 - 4.0 * f64::EPSILON;

impl Region {
    /// Creates the region of vectors within a bound. Not real-time.
    #[must_use]
    pub fn of(bound: Bound) -> Self {
        let radius = bound.norm().min(ENDLESS);
        let half_sides = DVec3::from_array(bound.axes()).min(DVec3::splat(ENDLESS));
        let inner = radius.min(half_sides.min_element()) * SURELY_INSIDE;
        Self { bound, half_sides, radius, radius_squared: radius * radius, inner_squared: inner * inner }
    }

    /// Returns the bound. Not real-time.
    pub fn bound(&self) -> Bound {
        self.bound
    }

    /// Returns true if a vector is in the region; false for NaN. One comparison suffices for most vectors, which are
    /// far inside; a tick calls this function five times.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn holds(&self, vector: DVec3) -> bool {
        let squared = vector.length_squared();
        squared < self.inner_squared
            || (vector.abs().cmple(self.half_sides).all() && squared <= self.radius_squared)
    }

    /// Shortens a vector to the region in its direction: returns `vector` if it is inside, zero if it is not finite.
    /// Components along axes with a half side of zero are set to zero, and do not shorten the others. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn shrink(&self, vector: DVec3) -> DVec3 {
        let vector = DVec3::select(self.half_sides.cmpeq(DVec3::ZERO), DVec3::ZERO, vector);
        if self.holds(vector) {
            return vector;
        }
        // The clamp below would turn it into a corner of the box.
        if !vector.is_finite() {
            return DVec3::ZERO;
        }
        let shrunk = (vector / self.excess(vector)).clamp(-self.half_sides, self.half_sides);
        // Rounding may have put the vector just outside.
        if self.holds(shrunk) { shrunk } else { shrunk * SURELY_INSIDE }
    }

    /// Returns the length of a vector, divided by the length of the longest vector of the same direction in the region:
    /// above 1 outside, 0 for a zero vector. Real-time: bounded, no allocation.
    #[must_use]
    pub fn excess(&self, vector: DVec3) -> f64 {
        // By the largest component: the square of a length may overflow.
        let largest = vector.abs().max_element();
        let of_radius = (vector / largest).length() * (largest / self.radius);
        // 0/0 on an axis that is not driven is not an excess; nor is that of a zero vector.
        (vector.abs() / self.half_sides).to_array().into_iter().chain([of_radius]).fold(0.0, f64::max)
    }

    /// Returns true if [`Self::shrink`] reduced a component along a driven axis; the start of a session has already reported
    /// the other axes. Real-time: bounded, no allocation.
    #[must_use]
    pub fn has_cut(&self, before: DVec3, after: DVec3) -> bool {
        (before.cmpne(after) & self.half_sides.cmpne(DVec3::ZERO)).any()
    }
}

#[cfg(test)]
mod tests;
