//! Extension `flotor.activity/1`: where a force model can act, by which a host may leave it asleep elsewhere.

use crate::{DVec3, ForceModel};

/// What kind of region it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActivityShape {
    /// The model may act at any position: it is never asleep.
    Everywhere,
    /// A ball.
    Sphere,
    /// A box with sides along the axes of the model frame.
    Box,
}

/// The positions of the handle, in the model frame, at which a model may act. 56 bytes.
///
/// Outside the region wrench and stored energy are **zero at every orientation and velocity**, and the model has
/// **no history**: the first step inside is as after [`ForceModel::reset`]. The region may be larger than
/// necessary, never smaller; the host checks nothing and skips the step.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ActivityRegion {
    shape: u32,
    reserved: u32,
    center_m: [f64; 3],
    half_sides_m: [f64; 3],
}

impl ActivityRegion {
    /// No position is excluded.
    pub const EVERYWHERE: Self =
        Self { shape: 0, reserved: 0, center_m: [0.0; 3], half_sides_m: [f64::INFINITY; 3] };

    /// A ball about `center_m`.
    #[must_use]
    pub const fn sphere(center_m: [f64; 3], radius_m: f64) -> Self {
        Self { shape: 1, reserved: 0, center_m, half_sides_m: [radius_m; 3] }
    }

    /// A box about `center_m`, half its sides given, along the axes of the model frame.
    #[must_use]
    pub const fn cuboid(center_m: [f64; 3], half_sides_m: [f64; 3]) -> Self {
        Self { shape: 2, reserved: 0, center_m, half_sides_m }
    }

    /// What kind of region it is. Anything unknown, and a region with a number that is none, is everywhere: the safe
    /// reading.
    #[must_use]
    pub fn shape(&self) -> ActivityShape {
        let numbers = self.center_m.iter().chain(&self.half_sides_m);
        if !numbers.into_iter().all(|number| number.is_finite()) {
            return ActivityShape::Everywhere;
        }
        match self.shape {
            1 => ActivityShape::Sphere,
            2 => ActivityShape::Box,
            _ => ActivityShape::Everywhere,
        }
    }

    /// Its centre, m.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        DVec3::from_array(self.center_m)
    }

    /// Half the sides of the box about it along the axes, m (for a ball, its radius three times).
    #[must_use]
    pub fn half_sides(&self) -> DVec3 {
        DVec3::from_array(self.half_sides_m)
    }

    /// True if the model may act with the handle at `position_m`. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contains(&self, position_m: DVec3) -> bool {
        let from_center = position_m - self.center();
        match self.shape() {
            ActivityShape::Everywhere => true,
            ActivityShape::Sphere => from_center.length() <= self.half_sides().x,
            ActivityShape::Box => from_center.abs().cmple(self.half_sides()).all(),
        }
    }
}

/// A force model that acts in a bounded region only: a scene may hold thousands of them.
pub trait LocalModel: ForceModel {
    /// Where it may act, with the parameters now in force. Real-time: bounded, no allocation (asked again after
    /// each live parameter).
    fn activity(&self) -> ActivityRegion;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_contains_its_surface_and_nothing_beyond() {
        let ball = ActivityRegion::sphere([1.0, 0.0, 0.0], 0.5);
        assert!(ball.contains(DVec3::new(1.5, 0.0, 0.0)) && !ball.contains(DVec3::new(1.4, 0.4, 0.0)));
        let cuboid = ActivityRegion::cuboid([0.0; 3], [1.0, 2.0, 3.0]);
        assert!(cuboid.contains(DVec3::new(-1.0, 2.0, -3.0)) && !cuboid.contains(DVec3::new(0.0, 2.1, 0.0)));
        assert!(ActivityRegion::EVERYWHERE.contains(DVec3::splat(1.0e300)));
    }

    #[test]
    fn a_region_that_makes_no_sense_excludes_nothing() {
        for wrong in
            [ActivityRegion::sphere([f64::NAN, 0.0, 0.0], 1.0), ActivityRegion::sphere([0.0; 3], f64::NAN)]
        {
            assert_eq!(wrong.shape(), ActivityShape::Everywhere);
            assert!(wrong.contains(DVec3::splat(9.0)));
        }
        let unknown = ActivityRegion { shape: 7, ..ActivityRegion::sphere([0.0; 3], 1.0) };
        assert_eq!(unknown.shape(), ActivityShape::Everywhere);
    }
}
