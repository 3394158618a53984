//! Extension `flotor.active-region/1`: region in which a force model can act; outside it a host may skip the model.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter};
use crate::{DVec3, ForceModel};

/// Shape of an active region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionShape {
    /// The model may act at any position: it is never inactive.
    Everywhere,
    /// Ball; each of its half extents is the radius.
    Sphere,
    /// Box with sides along the axes of the model frame.
    Box,
}

/// Positions of the handle, in the model frame, at which a model may act. 56 bytes.
///
/// Outside the region wrench and stored energy are **zero at every orientation and velocity**, and the model has
/// **no history**: the first step inside is as after [`ForceModel::reset`]. The region may be larger than
/// necessary, never smaller: the host skips the step outside without a check.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct ActiveRegion {
    shape: u32,
    reserved: u32,
    center_m: [f64; 3],
    half_sides_m: [f64; 3],
}

impl ActiveRegion {
    /// Region without limits.
    pub const EVERYWHERE: Self =
        Self { shape: 0, reserved: 0, center_m: [0.0; 3], half_sides_m: [f64::INFINITY; 3] };

    /// Builds a ball about `center_m` (m, model frame).
    pub const fn sphere(center_m: [f64; 3], radius_m: f64) -> Self {
        Self { shape: 1, reserved: 0, center_m, half_sides_m: [radius_m; 3] }
    }

    /// Builds a box about `center_m` from its half extents, both in m, with sides along the axes of the model frame.
    pub const fn cuboid(center_m: [f64; 3], half_sides_m: [f64; 3]) -> Self {
        Self { shape: 2, reserved: 0, center_m, half_sides_m }
    }

    /// Returns the shape of the region; an unknown code or a number that is not finite counts as everywhere, the safe
    /// choice.
    #[must_use]
    pub fn shape(&self) -> RegionShape {
        let numbers = self.center_m.iter().chain(&self.half_sides_m);
        if !numbers.into_iter().all(|number| number.is_finite()) {
            return RegionShape::Everywhere;
        }
        match self.shape {
            1 => RegionShape::Sphere,
            2 => RegionShape::Box,
            _ => RegionShape::Everywhere,
        }
    }

    /// Returns the centre, m, model frame; zero for a region without limits.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        DVec3::from_array(self.center_m)
    }

    /// Returns the half extents of the bounding box, m (for a ball, each is the radius); infinite for [`Self::EVERYWHERE`].
    #[must_use]
    pub fn half_sides(&self) -> DVec3 {
        DVec3::from_array(self.half_sides_m)
    }

    /// Returns true if the model may act with the handle at `position_m`. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contains(&self, position_m: DVec3) -> bool {
        let from_center = position_m - self.center();
        match self.shape() {
            RegionShape::Everywhere => true,
            RegionShape::Sphere => from_center.length() <= self.half_sides().x,
            RegionShape::Box => from_center.abs().cmple(self.half_sides()).all(),
        }
    }
}

/// Force model that acts in a bounded region only: a scene may contain thousands of such models.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A ball of foam, 10 mm in radius, 12 mm below home: `export_model!(Foam, active_region)`.
/// impl ActiveRegionModel for Foam {
///     fn active_region(&self) -> ActiveRegion {
///         ActiveRegion::sphere([0.0, 0.0, -0.012], 0.01)
///     }
/// }
/// # let foam = Foam { depth_m: 0.0, look: Shape::default() };
/// assert!(foam.active_region().contains(DVec3::Z * -0.005));
/// assert!(!foam.active_region().contains(DVec3::ZERO));
/// ```
pub trait ActiveRegionModel: ForceModel {
    /// Returns the region in which the model may act, with the current parameters. Real-time: bounded, no allocation
    /// (called again after each live parameter).
    fn active_region(&self) -> ActiveRegion;
}

/// Function table `flotor.active-region/1`: see [`ActiveRegionModel`]. Real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ActiveRegionTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the active region with the current parameters; returns a [`crate::abi::CallStatus`] code.
    pub region: Option<unsafe extern "C" fn(instance: Instance, out: *mut ActiveRegion) -> u32>,
}

layout! {
    ActiveRegion { shape, reserved, center_m, half_sides_m }
    ActiveRegionTable { size, reserved, region }
}
unsafe extern "C" fn region<M: ActiveRegionModel>(instance: Instance, out: *mut ActiveRegion) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, out, |model| Ok(model.active_region())) }
}

table!(ActiveRegionTable: "flotor.active-region/1", M: [ActiveRegionModel] {
    reserved: 0,
    region: Some(region::<M>),
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_contains_its_surface_and_nothing_beyond() {
        let ball = ActiveRegion::sphere([1.0, 0.0, 0.0], 0.5);
        assert!(ball.contains(DVec3::new(1.5, 0.0, 0.0)) && !ball.contains(DVec3::new(1.4, 0.4, 0.0)));
        let cuboid = ActiveRegion::cuboid([0.0; 3], [1.0, 2.0, 3.0]);
        assert!(cuboid.contains(DVec3::new(-1.0, 2.0, -3.0)) && !cuboid.contains(DVec3::new(0.0, 2.1, 0.0)));
        assert!(ActiveRegion::EVERYWHERE.contains(DVec3::splat(1.0e300)));
    }

    #[test]
    fn a_region_that_makes_no_sense_excludes_nothing() {
        for wrong in
            [ActiveRegion::sphere([f64::NAN, 0.0, 0.0], 1.0), ActiveRegion::sphere([0.0; 3], f64::NAN)]
        {
            assert_eq!(wrong.shape(), RegionShape::Everywhere);
            assert!(wrong.contains(DVec3::splat(9.0)));
        }
        let unknown = ActiveRegion { shape: 7, ..ActiveRegion::sphere([0.0; 3], 1.0) };
        assert_eq!(unknown.shape(), RegionShape::Everywhere);
    }
}
