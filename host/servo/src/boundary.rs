//! The wall at the edge of a device's range: spring and damper that push back what has left it, and never pull.
//!
//! The range is an ellipsoid of positions and one of rotation vectors; equal semi-axes make it the sphere of the
//! thesis's boundary (section 3.2). Nearly every tick is inside, so that is seen first, without a root or an arc.
//!
//! Stiffness and place of the wall are those of a [`RenderedBoundary`].

use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_hal::{DVec3, DeviceState, Wrench, rotation_vector};
use std::f64::consts::PI;

/// The wall of one device.
pub(super) struct BoundaryWall {
    position: Ellipsoid,
    rotation: Ellipsoid,
}

impl BoundaryWall {
    /// A wall as it is rendered on a device. Not real-time.
    pub(super) fn new(rendered: &RenderedBoundary) -> Self {
        let RenderedBoundary {
            begins_m,
            begins_rad,
            stiffness_n_per_m,
            damping_ns_per_m,
            stiffness_nm_per_rad,
            damping_nms_per_rad,
            ..
        } = *rendered;
        Self {
            position: Ellipsoid::new(begins_m, stiffness_n_per_m, damping_ns_per_m),
            rotation: Ellipsoid::new(begins_rad, stiffness_nm_per_rad, damping_nms_per_rad),
        }
    }

    /// The push of the wall; `None` inside, and where nobody knows where the handle is. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn push(&self, state: &DeviceState) -> Option<Wrench> {
        if self.surely_holds(state) { None } else { self.push_outside(state) }
    }

    /// True only inside. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn surely_holds(&self, state: &DeviceState) -> bool {
        // A rotation vector is the axis times the angle, which is at most pi times the sine of its half.
        let at_most_rad = state.pose.orientation().xyz() * PI;
        self.position.surely_holds(state.pose.position()) && self.rotation.surely_holds(at_most_rad)
    }

    fn push_outside(&self, state: &DeviceState) -> Option<Wrench> {
        if !state.is_finite() {
            return None;
        }
        let force = self.position.push(state.pose.position(), state.twist.linear());
        let torque = self.rotation.push(rotation_vector(state.pose.orientation()), state.twist.angular());
        if force.is_none() && torque.is_none() {
            return None;
        }
        Some(Wrench::new(force.unwrap_or(DVec3::ZERO), torque.unwrap_or(DVec3::ZERO)))
    }
}

/// Where translation or rotation may be, and what it meets outside. Metres and newtons, or radians and newton metres.
struct Ellipsoid {
    /// Without end on an axis without range, so that nothing there is beyond it.
    semi_axes: DVec3,
    /// Their reciprocals.
    per_semi_axis: DVec3,
    /// Effort per way.
    stiffness: f64,
    /// Effort per speed.
    damping: f64,
}

/// Squared distance from the centre, in semi-axes, below which rounding cannot make an inside of an outside.
const SURELY_INSIDE: f64 = 1.0 - 1.0e-12;

impl Ellipsoid {
    fn new(semi_axes: [f64; 3], stiffness: f64, damping: f64) -> Self {
        let semi_axes = DVec3::from_array(semi_axes);
        Self { semi_axes, per_semi_axis: semi_axes.recip(), stiffness, damping }
    }

    /// True only inside.
    #[inline]
    fn surely_holds(&self, at: DVec3) -> bool {
        (at * self.per_semi_axis).length_squared() < SURELY_INSIDE // false for NaN
    }

    /// Spring and damper along the ray from the centre; `None` inside. Damping acts outwards only: the wall never
    /// pulls.
    fn push(&self, at: DVec3, velocity: DVec3) -> Option<DVec3> {
        let at = DVec3::select(self.semi_axes.cmpeq(DVec3::INFINITY), DVec3::ZERO, at);
        let beyond = (at / self.semi_axes).length();
        if beyond.is_nan() || beyond <= 1.0 {
            return None;
        }
        let distance = at.length();
        // Depth beyond the ellipsoid along the ray; the force is k depth + b v, v outwards only.
        let outward = at / distance;
        let depth = distance - distance / beyond;
        let push = (self.stiffness * depth + self.damping * velocity.dot(outward).max(0.0)).max(0.0);
        Some(outward * -push)
    }
}

#[cfg(test)]
mod tests;
