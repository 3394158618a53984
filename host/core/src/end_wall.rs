//! Wall at the workspace bounds of a model: a spring and a damper that push the handle back and never pull.
//!
//! The wall is part of the model's contribution: wall and model fade together, yield together to a higher priority, and are removed
//! together. The [boundary](crate::limits::Boundary) of the device acts as well; the handle meets the nearer of the two walls first.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::mapping::Mapping;
use flotor_hal::{DVec3, Damper, Pose, SampledLoop, Twist, WorkspaceBounds, Wrench};

/// Damping of the wall, N·s/m, as in the device's own boundary mode (client program of the University of Utah).
const DAMPING_NS_PER_M: f64 = 15.0;

/// Largest stiffness of the wall, N/m, as of the [boundary](crate::limits::Boundary) at 1 kHz.
const MAX_STIFFNESS_N_PER_M: f64 = 7_500.0;

/// Returns true if a wall at these bounds would push the handle at the home pose of its device. Real-time: bounded, no allocation.
#[must_use]
pub fn pushes_at_home(bounds: &WorkspaceBounds, mapping: &Mapping) -> bool {
    bounds.is_bounded() && bounds.beyond(mapping.pose_to_model(&Pose::HOME).position()) != DVec3::ZERO
}

/// Wall of one instance of a model.
#[derive(Clone, Copy, Debug)]
pub struct EndWall {
    bounds: WorkspaceBounds,
    stiffness_n_per_m: f64,
}

impl EndWall {
    /// Creates a wall with the largest stable stiffness of the loop, up to 7500 N/m; `None` for a model without bounds. Not real-time.
    #[must_use]
    pub fn new(bounds: &WorkspaceBounds, mapping: &Mapping, sampled: &SampledLoop) -> Option<Self> {
        // The damping of the device is not known.
        let stable_n_per_m = sampled.largest_stiffness(0.0, Damper::OneWay(DAMPING_NS_PER_M));
        let stiffness_n_per_m = MAX_STIFFNESS_N_PER_M.min(stable_n_per_m);
        bounds.is_bounded().then(|| {
            let mut wall = Self { bounds: WorkspaceBounds::UNBOUNDED, stiffness_n_per_m };
            wall.move_to(bounds, mapping);
            wall
        })
    }

    /// Moves the wall to new bounds; removes a wall that would push at the home pose of the device. Real-time: bounded, no allocation.
    pub fn move_to(&mut self, bounds: &WorkspaceBounds, mapping: &Mapping) {
        let is_wall = bounds.is_bounded() && !pushes_at_home(bounds, mapping);
        self.bounds = if is_wall { *bounds } else { WorkspaceBounds::UNBOUNDED };
    }

    /// Returns the wall force on the handle, device frame; `None` within the bounds. `pose` is in the model frame, `twist` in the
    /// device frame. Real-time: bounded, no allocation.
    #[inline(always)] // in the middle of a tick
    #[must_use]
    pub fn push(&self, pose: &Pose, mapping: &Mapping, twist: &Twist) -> Option<Wrench> {
        let beyond_m = self.bounds.beyond(pose.position());
        if beyond_m == DVec3::ZERO || !beyond_m.is_finite() {
            return None;
        }
        let beyond_m = mapping.vector_to_device(beyond_m);
        let depth_m = beyond_m.length();
        let outward = beyond_m / depth_m;
        // Damping acts outwards only, as in the boundary.
        let leaving_m_per_s = twist.linear().dot(outward).max(0.0);
        let push_n = self.stiffness_n_per_m * depth_m + DAMPING_NS_PER_M * leaving_m_per_s;
        Some(Wrench::from_force(outward * -push_n))
    }
}

#[cfg(test)]
mod tests;
