//! Extension `flotor.reach/1`: how far a force model means the handle to go.
//!
//! A spring ends where its coils touch, a table of measured forces where it was measured. Beyond, the model still answers,
//! but what it says is not what its subject would do. A host puts a wall there, if its own is farther out.

use crate::{DVec3, ForceModel};

/// The positions of the handle, in the model frame, that a model is made for: a box along its axes. 48 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Reach {
    lower_m: [f64; 3],
    upper_m: [f64; 3],
}

impl Reach {
    /// No end on any axis.
    pub const UNBOUNDED: Self = Self { lower_m: [f64::NEG_INFINITY; 3], upper_m: [f64::INFINITY; 3] };

    /// From `lower_m` to `upper_m`; infinite where there is no end.
    #[must_use]
    pub const fn between(lower_m: [f64; 3], upper_m: [f64; 3]) -> Self {
        Self { lower_m, upper_m }
    }

    /// True if there is an end anywhere. A box with home outside, or with a limit that is no number, bounds nothing: a
    /// wall there would throw the handle out of where a run begins.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        let (lower, upper) = (DVec3::from_array(self.lower_m), DVec3::from_array(self.upper_m));
        let holds_home = lower.cmple(DVec3::ZERO).all() && upper.cmpge(DVec3::ZERO).all(); // false for NaN
        holds_home && *self != Self::UNBOUNDED
    }

    /// The way from its nearest point to a position, m; zero inside. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn beyond(&self, position_m: DVec3) -> DVec3 {
        position_m - position_m.clamp(DVec3::from_array(self.lower_m), DVec3::from_array(self.upper_m))
    }
}

/// A force model with an end.
pub trait BoundedModel: ForceModel {
    /// Where it ends, with the parameters now in force. Real-time: bounded, no allocation (asked again after each live
    /// parameter).
    fn reach(&self) -> Reach;
}

#[cfg(test)]
mod tests {
    use super::*;

    const INFINITY: f64 = f64::INFINITY;

    #[test]
    fn beyond_is_the_shortest_way_back() {
        let reach = Reach::between([-INFINITY, -1.0, -0.5], [INFINITY, 1.0, INFINITY]);
        assert!(reach.is_bounded());
        assert_eq!(reach.beyond(DVec3::new(9.0, 1.0, -0.5)), DVec3::ZERO);
        assert_eq!(reach.beyond(DVec3::new(9.0, 3.0, -1.0)), DVec3::new(0.0, 2.0, -0.5));
    }

    #[test]
    fn what_makes_no_sense_bounds_nothing() {
        let above_home = Reach::between([-1.0, -1.0, 0.1], [1.0; 3]);
        let nowhere = Reach::between([f64::NAN; 3], [1.0; 3]);
        for reach in [Reach::UNBOUNDED, above_home, nowhere] {
            assert!(!reach.is_bounded(), "{reach:?}");
        }
    }
}
