//! The wall at the edge of a device's range: spring and damper that push back what has left it, and never pull.
//!
//! The range is an ellipsoid of positions and one of rotation vectors; equal semi-axes make it the sphere of the
//! thesis's boundary (section 3.2). Nearly every tick is inside, so that is seen first, without a root or an arc.
//!
//! Home is always well inside: a margin takes at most half of the range, and along an axis without range there is no wall.
//! (Pairing has refused a margin that leaves nothing.)

use flotor_core::limits::Boundary;
use flotor_hal::{Capabilities, DVec3, DeviceState, Wrench, rotation_vector};
use std::f64::consts::PI;

/// The wall of one device.
pub(super) struct BoundaryWall {
    position: Ellipsoid,
    rotation: Ellipsoid,
}

impl BoundaryWall {
    /// A wall the boundary's margin inside the device's range, no stiffer than the device and a loop of this period render
    /// stably. Not real-time.
    pub(super) fn new(boundary: &Boundary, device: &Capabilities, period_ns: u64) -> Self {
        let Boundary {
            margin_m,
            margin_rad,
            stiffness_n_per_m,
            damping_ns_per_m,
            stiffness_nm_per_rad,
            damping_nms_per_rad,
        } = *boundary;
        let stiffness_n_per_m = stiffness_n_per_m
            .min(stable_stiffness(damping_ns_per_m, period_ns))
            .min(declared(device.max_stiffness_n_per_m));
        let stiffness_nm_per_rad = stiffness_nm_per_rad.min(stable_stiffness(damping_nms_per_rad, period_ns));
        Self {
            position: Ellipsoid::new(device.range_m, margin_m, stiffness_n_per_m, damping_ns_per_m),
            rotation: Ellipsoid::new(device.range_rad, margin_rad, stiffness_nm_per_rad, damping_nms_per_rad),
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

/// Share of the stiffness at which a sampled wall of a damping begins to add energy, `B / (T / 2)` (Gil et al. 2009, without
/// damping of the plant).
const STABILITY_MARGIN: f64 = 0.5;

/// How stiff a wall of this damping may be in a loop of this period. One without a damper is what its scene says: only the
/// device's own damping can hold it. Not real-time.
pub(super) fn stable_stiffness(damping: f64, period_ns: u64) -> f64 {
    let half_a_period_s = 0.5 * period_ns as f64 * 1.0e-9;
    if damping > 0.0 { STABILITY_MARGIN * damping / half_a_period_s } else { f64::INFINITY }
}

/// A limit, if the device declares one.
fn declared(limit: f64) -> f64 {
    if limit > 0.0 { limit } else { f64::INFINITY }
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

/// Part of the range that is free of the wall, whatever the margin.
const LEAST_SHARE_OF_RANGE: f64 = 0.5;

impl Ellipsoid {
    fn new(range: [f64; 3], margin: f64, stiffness: f64, damping: f64) -> Self {
        let range = DVec3::from_array(range);
        let inside = (range - margin).max(range * LEAST_SHARE_OF_RANGE);
        // Where nobody says how far the handle goes, nobody knows where a wall belongs.
        let semi_axes = DVec3::select(range.cmpgt(DVec3::ZERO), inside, DVec3::INFINITY);
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
