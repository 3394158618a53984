//! Extension `flotor.centerline/1`: the shape of a slender deformable body, for people to look at.
//!
//! An observer makes its own instance of the model with the same parameters and asks it at its own rate;
//! the servo never calls this. A curve with a frame along it draws a rod, a rope or (with turns) a coil spring.

use crate::{ForceModel, Input, Pose};

/// How to draw the body around its centreline: a tube, or a wire wound about it. 40 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CenterlineInfo {
    /// Radius of the drawn tube or wire, m.
    pub tube_radius_m: f64,
    /// Radius of the helix the wire follows about the centreline, m; 0 draws a plain tube.
    pub helix_radius_m: f64,
    /// Turns of the helix over the whole length; 0 for a plain tube.
    pub helix_turns: f64,
    /// Radius of the end plates, m; 0 for none.
    pub plate_radius_m: f64,
    /// How many points describe the centreline well.
    pub suggested_points: u32,
    pub(crate) reserved: u32,
}

impl CenterlineInfo {
    /// A wire of radius `wire_radius_m` wound `turns` times at `helix_radius_m` between plates.
    #[must_use]
    pub const fn coil(wire_radius_m: f64, helix_radius_m: f64, turns: f64, plate_radius_m: f64) -> Self {
        Self {
            tube_radius_m: wire_radius_m,
            helix_radius_m,
            helix_turns: turns,
            plate_radius_m,
            suggested_points: 65,
            reserved: 0,
        }
    }
}

/// A force model with a shape. Not real-time.
pub trait CenterlineModel: ForceModel {
    /// How to draw the body with the parameters now in force.
    fn centerline_info(&self) -> CenterlineInfo;

    /// Fills `points` from the fixed end to the handle, evenly in arc length of the undeformed body: position
    /// (m, model frame) and section frame (z along the section normal). Returns how many are valid.
    fn centerline(&mut self, input: &Input, points: &mut [Pose]) -> usize;
}
