//! The vectors (forces, torques, velocities) that limits allow: a ball and a box that hold together.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::limits::Bound;
use flotor_hal::DVec3;

/// A ball around zero and a box around zero, in the unit of their bound. Convex.
#[derive(Clone, Debug)]
pub struct Region {
    bound: Bound,
    /// Half the sides of the box.
    half_sides: DVec3,
    radius: f64,
    /// Its square, finite.
    radius_squared: f64,
    /// Square of the radius of a ball that is in both, with room for rounding; 0 where there is none.
    inner_squared: f64,
}

/// A ball without end has this radius, so that its square is a number: what is in a region is finite.
const ENDLESS: f64 = 1.0e150;

/// A vector scaled to the radius, and by this, is in the ball.
const SURELY_INSIDE: f64 = 1.0 - 4.0 * f64::EPSILON;

impl Region {
    /// The vectors within a bound. Not real-time.
    #[must_use]
    pub fn of(bound: Bound) -> Self {
        let radius = bound.norm().min(ENDLESS);
        let half_sides = DVec3::from_array(bound.axes()).min(DVec3::splat(ENDLESS));
        let inner = radius.min(half_sides.min_element()) * SURELY_INSIDE;
        Self { bound, half_sides, radius, radius_squared: radius * radius, inner_squared: inner * inner }
    }

    /// Returns its bound. Not real-time.
    #[must_use]
    pub fn bound(&self) -> Bound {
        self.bound
    }

    /// Returns true if a vector is in the region; false for NaN. Most are well inside, which one comparison shows; a tick asks five
    /// times.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn holds(&self, vector: DVec3) -> bool {
        let squared = vector.length_squared();
        squared < self.inner_squared
            || (vector.abs().cmple(self.half_sides).all() && squared <= self.radius_squared)
    }

    /// Returns the longest vector in the region of the same direction, not longer than `vector`; zero for what is no number. Axes with a
    /// half side of zero are left out: what cannot be driven takes nothing from what can. Real-time: bounded, no allocation.
    #[must_use]
    pub fn shrink(&self, vector: DVec3) -> DVec3 {
        let vector = DVec3::select(self.half_sides.cmpeq(DVec3::ZERO), DVec3::ZERO, vector);
        if self.holds(vector) {
            return vector;
        }
        // The clamp below would make a corner of it.
        if !vector.is_finite() {
            return DVec3::ZERO;
        }
        let shrunk = (vector / self.excess(vector)).clamp(-self.half_sides, self.half_sides);
        // However its length was rounded.
        if self.holds(shrunk) { shrunk } else { shrunk * SURELY_INSIDE }
    }

    /// Returns the ratio of a vector to the longest one of its direction in the region. Real-time: bounded, no allocation.
    #[must_use]
    pub fn excess(&self, vector: DVec3) -> f64 {
        // By the largest component: the square of a length may be more than any number.
        let largest = vector.abs().max_element();
        let of_radius = (vector / largest).length() * (largest / self.radius);
        // 0/0 on an axis that is not driven is no excess; nor is that of no vector.
        (vector.abs() / self.half_sides).to_array().into_iter().chain([of_radius]).fold(0.0, f64::max)
    }

    /// Returns true if `shrink` took anything away along an axis that is driven: of the others pairing has said that nothing is felt
    /// there. Real-time: bounded, no allocation.
    #[must_use]
    pub fn has_cut(&self, before: DVec3, after: DVec3) -> bool {
        (before.cmpne(after) & self.half_sides.cmpne(DVec3::ZERO)).any()
    }
}

#[cfg(test)]
mod tests;
