//! The vectors (forces, torques, velocities) that are allowed: a ball and a box that hold together.

use flotor_core::limits::Bound;
use flotor_hal::DVec3;

/// A ball around zero and a box around zero, in the unit of their bound. Convex.
pub(super) struct Region {
    bound: Bound,
    /// Half the sides of the box.
    half_sides: DVec3,
    radius: f64,
    /// Its square, finite.
    radius_squared: f64,
}

/// A ball without end has this radius, so that its square is a number: what is in a region is finite.
const ENDLESS: f64 = 1.0e150;

/// A vector scaled to the radius, and by this, is in the ball.
const SURELY_INSIDE: f64 = 1.0 - 4.0 * f64::EPSILON;

impl Region {
    /// Not real-time.
    pub(super) fn of(bound: Bound) -> Self {
        let radius = bound.norm().min(ENDLESS);
        let half_sides = DVec3::from_array(bound.axes()).min(DVec3::splat(ENDLESS));
        Self { bound, half_sides, radius, radius_squared: radius * radius }
    }

    /// What it was made of. Not real-time.
    pub(super) fn bound(&self) -> Bound {
        self.bound
    }

    /// True if a vector is in it; false for NaN. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn holds(&self, vector: DVec3) -> bool {
        vector.abs().cmple(self.half_sides).all() && vector.length_squared() <= self.radius_squared
    }

    /// The longest vector in it of the same direction, not longer than `vector`. Axes with a half side of zero are left out:
    /// what cannot be driven takes nothing from what can. Real-time: bounded, no allocation.
    pub(super) fn shrink(&self, vector: DVec3) -> DVec3 {
        let vector = DVec3::select(self.half_sides.cmpeq(DVec3::ZERO), DVec3::ZERO, vector);
        if self.holds(vector) {
            return vector;
        }
        let shrunk = (vector / self.excess(vector)).clamp(-self.half_sides, self.half_sides);
        // However its length was rounded.
        if self.holds(shrunk) { shrunk } else { shrunk * SURELY_INSIDE }
    }

    /// How many times the longest vector in it of the same direction a vector is. Real-time: bounded, no allocation.
    pub(super) fn excess(&self, vector: DVec3) -> f64 {
        // By the largest component: the square of a length may be more than any number.
        let largest = vector.abs().max_element();
        let of_radius = (vector / largest).length() * (largest / self.radius);
        // 0/0 on an axis that is not driven is no excess; nor is that of no vector.
        (vector.abs() / self.half_sides).to_array().into_iter().chain([of_radius]).fold(0.0, f64::max)
    }

    /// True if `shrink` took anything away along an axis that is driven: of the others pairing has said that nothing is felt
    /// there. Real-time: bounded, no allocation.
    pub(super) fn has_cut(&self, before: DVec3, after: DVec3) -> bool {
        (before.cmpne(after) & self.half_sides.cmpne(DVec3::ZERO)).any()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: DVec3 = DVec3::new(30.0, -40.0, 1.0);

    #[test]
    fn a_ball_shortens_and_keeps_the_direction() {
        let ball = Region::of(Bound::ball(5.0));
        let inside = DVec3::new(3.0, -4.0, 0.0);
        assert_eq!(ball.shrink(inside), inside, "as long as the radius is in it");
        let shrunk = ball.shrink(FORCE);
        assert!((shrunk.length() - 5.0).abs() < 1.0e-14 && ball.holds(shrunk), "{shrunk}");
        assert!(shrunk.cross(FORCE).length() < 1.0e-14 * 250.0, "{shrunk}");
        assert!(ball.has_cut(FORCE, shrunk) && !ball.has_cut(inside, inside));
        assert_eq!(Region::of(Bound::ball(0.0)).shrink(FORCE), DVec3::ZERO);
    }

    #[test]
    fn the_tighter_of_ball_and_box_decides() {
        let region = |norm| Region::of(Bound::ball(norm).and(Bound::box_of([3.0, 3.0, 3.0])));
        assert!((region(9.0).shrink(FORCE).y + 3.0).abs() < 1.0e-15, "the box");
        assert!((region(2.0).shrink(FORCE).length() - 2.0).abs() < 1.0e-15, "the ball");
    }

    #[test]
    fn what_is_not_driven_takes_nothing_of_the_norm() {
        let planar = Region::of(Bound::ball(5.0).and(Bound::box_of([9.0, 9.0, 0.0])));
        let sent = planar.shrink(DVec3::new(3.0, 4.0, 700.0));
        assert_eq!(sent, DVec3::new(3.0, 4.0, 0.0));
        assert!(!planar.has_cut(DVec3::new(3.0, 4.0, 700.0), sent));
    }

    #[test]
    fn a_region_without_end_passes_what_is_finite_and_nothing_overflows() {
        let endless = Region::of(Bound::NONE);
        assert_eq!(endless.shrink(FORCE), FORCE);
        let ball = Region::of(Bound::ball(1.0));
        for length in [1.0e154, 1.0e300] {
            let shrunk = ball.shrink(DVec3::new(length, length, 0.0));
            assert!((shrunk.length() - 1.0).abs() < 1.0e-12, "{shrunk}");
            assert!(endless.shrink(DVec3::splat(length)).is_finite());
        }
        // Where how many times it is too long is no number, nothing is left of it.
        assert_eq!(ball.shrink(DVec3::splat(f64::MAX)), DVec3::ZERO);
    }
}
