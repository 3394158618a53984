//! Extension `flotor.workspace-bounds/1`: workspace limits of a force model.
//!
//! The model of a spring is valid until its coils touch, a table of measured forces up to the last measurement. Beyond, the model
//! still returns a wrench, but not the wrench of the real object. A host renders a wall at these limits if its own wall is farther
//! out.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter};
use crate::{DVec3, ForceModel};

/// Positions of the handle, in the model frame, for which a model is valid: a box along the axes. 48 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct WorkspaceBounds {
    lower_m: [f64; 3],
    upper_m: [f64; 3],
}

impl WorkspaceBounds {
    /// Bounds without a limit on any axis.
    pub const UNBOUNDED: Self = Self { lower_m: [f64::NEG_INFINITY; 3], upper_m: [f64::INFINITY; 3] };

    /// Builds bounds from `lower_m` to `upper_m` (m, model frame); infinite for no limit.
    pub const fn between(lower_m: [f64; 3], upper_m: [f64; 3]) -> Self {
        Self { lower_m, upper_m }
    }

    /// Returns the lower and upper limits, m; infinite for no limit.
    #[must_use]
    pub const fn ends_m(&self) -> [[f64; 3]; 2] {
        [self.lower_m, self.upper_m]
    }

    /// Returns true if any axis has a limit; false for a box that excludes home or has a NaN limit, because a wall there
    /// would push the handle away from the start position of a run.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        let (lower, upper) = (DVec3::from_array(self.lower_m), DVec3::from_array(self.upper_m));
        let holds_home = lower.cmple(DVec3::ZERO).all() && upper.cmpge(DVec3::ZERO).all(); // false for NaN
        holds_home && *self != Self::UNBOUNDED
    }

    /// Returns the displacement from the nearest point of the box to a position, m; zero inside. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn beyond(&self, position_m: DVec3) -> DVec3 {
        position_m - position_m.clamp(DVec3::from_array(self.lower_m), DVec3::from_array(self.upper_m))
    }
}

/// Force model with workspace limits.
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
/// /// A cube of 40 mm about home, at whose sides a host renders a wall: `export_model!(Foam, workspace_bounds)`.
/// impl WorkspaceBoundsModel for Foam {
///     fn workspace_bounds(&self) -> WorkspaceBounds {
///         WorkspaceBounds::between([-0.02; 3], [0.02; 3])
///     }
/// }
/// # let foam = Foam { depth_m: 0.0, look: Shape::default() };
/// assert_eq!(foam.workspace_bounds().beyond(DVec3::X * 0.025), DVec3::X * (0.025 - 0.02));
/// ```
pub trait WorkspaceBoundsModel: ForceModel {
    /// Returns the limits with the current parameters. Real-time: bounded, no allocation (called again after each live
    /// parameter).
    fn workspace_bounds(&self) -> WorkspaceBounds;
}

/// Function table `flotor.workspace-bounds/1`: see [`WorkspaceBoundsModel`]. Real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct WorkspaceBoundsTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the limits with the current parameters; returns a [`crate::abi::CallStatus`] code.
    pub bounds: Option<unsafe extern "C" fn(instance: Instance, out: *mut WorkspaceBounds) -> u32>,
}

layout! {
    WorkspaceBounds { lower_m, upper_m }
    WorkspaceBoundsTable { size, reserved, bounds }
}
unsafe extern "C" fn bounds<M: WorkspaceBoundsModel>(instance: Instance, out: *mut WorkspaceBounds) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, out, |model| Ok(model.workspace_bounds())) }
}

table!(WorkspaceBoundsTable: "flotor.workspace-bounds/1", M: [WorkspaceBoundsModel] {
    reserved: 0,
    bounds: Some(bounds::<M>),
});

#[cfg(test)]
mod tests {
    use super::*;

    const INFINITY: f64 = f64::INFINITY;

    #[test]
    fn beyond_is_the_shortest_way_back() {
        let bounds = WorkspaceBounds::between([-INFINITY, -1.0, -0.5], [INFINITY, 1.0, INFINITY]);
        assert!(bounds.is_bounded());
        assert_eq!(bounds.beyond(DVec3::new(9.0, 1.0, -0.5)), DVec3::ZERO);
        assert_eq!(bounds.beyond(DVec3::new(9.0, 3.0, -1.0)), DVec3::new(0.0, 2.0, -0.5));
    }

    #[test]
    fn what_makes_no_sense_bounds_nothing() {
        let above_home = WorkspaceBounds::between([-1.0, -1.0, 0.1], [1.0; 3]);
        let nowhere = WorkspaceBounds::between([f64::NAN; 3], [1.0; 3]);
        for bounds in [WorkspaceBounds::UNBOUNDED, above_home, nowhere] {
            assert!(!bounds.is_bounded(), "{bounds:?}");
        }
    }
}
