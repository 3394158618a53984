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
mod tests {
    use super::*;
    use flotor_hal::{Pose, orientation_from_rotation_vector};

    /// What is surely inside meets no wall, anywhere near the edge of either range.
    #[test]
    fn nothing_that_meets_a_wall_is_taken_for_inside() {
        let ellipsoid = Ellipsoid::new([0.012, 0.01, 0.0], 0.0005, 1.0e4, 15.0);
        let mut outside = 0;
        for step in 0..10_000_u32 {
            let angle = f64::from(step) * 0.37;
            let direction = DVec3::new(angle.cos(), angle.sin(), 0.0) * DVec3::new(0.0115, 0.0095, 0.0);
            let at = direction * (1.0 + (f64::from(step % 41) - 20.0) * 1.0e-13);
            let pushed = ellipsoid.push(at, DVec3::ZERO).is_some();
            assert!(!(pushed && ellipsoid.surely_holds(at)), "{at}");
            outside += u32::from(pushed);
        }
        assert!((3000..7000).contains(&outside), "{outside} of 10 000");
        assert!(!ellipsoid.surely_holds(DVec3::NAN));
    }

    /// Whatever a device and a scene say, the wall leaves the handle alone at home, and a little beside it, where a sensor's
    /// noise puts it.
    #[test]
    fn a_wall_never_pushes_at_home() {
        let ranges = [0.0, 1.0e-9, 1.0e-4, 0.012, 1.0, f64::INFINITY];
        let margins = [0.0, 5.0e-4, 0.012, 0.1, 1.5];
        for (x, z, margin) in
            ranges.iter().flat_map(|x| ranges.map(|z| (*x, z))).flat_map(|(x, z)| margins.map(|m| (x, z, m)))
        {
            let device = Capabilities { range_m: [x, 0.012, z], range_rad: [z, x, 0.12], ..CAPABILITIES };
            let boundary = Boundary { margin_m: margin, margin_rad: margin, ..Boundary::default() };
            let wall = BoundaryWall::new(&boundary, &device, 1_000_000);
            let noise = |range: f64| if range > 0.0 { 0.2 * range.min(1.0) } else { 1.0e-3 };
            for share in [0.0, 1.0e-9, 1.0] {
                let mut state = DeviceState::HOME;
                let rotation = DVec3::new(noise(z), noise(x), 0.02) * share;
                let orientation = orientation_from_rotation_vector(rotation);
                state.pose = Pose::new(DVec3::new(noise(x), 0.002, noise(z)) * share, orientation);
                assert_eq!(
                    wall.push(&state),
                    None,
                    "range {x} and {z}, margin {margin}, {share} of the noise"
                );
            }
        }
    }

    /// A planar device that reports a height pushes in its plane only.
    #[test]
    fn an_axis_without_range_has_no_part_in_the_push() {
        let ellipsoid = Ellipsoid::new([0.05, 0.04, 0.0], 5.0e-4, 1.0e4, 15.0);
        let push = ellipsoid.push(DVec3::new(0.0505, 0.0, 0.3), DVec3::Z * 9.0).expect("a millimetre beyond");
        assert!((push - DVec3::X * -10.0).length() < 1.0e-9, "{push}");
    }

    #[test]
    fn a_rotation_that_meets_a_wall_is_not_taken_for_inside() {
        let boundary = Boundary::default();
        let device = Capabilities { range_m: [1.0; 3], range_rad: [0.12, 3.0, 0.5], ..CAPABILITIES };
        let wall = BoundaryWall::new(&boundary, &device, 1_000_000);
        for step in 0..20_000_u32 {
            let turn = f64::from(step);
            let direction = DVec3::new((turn * 0.7).sin(), (turn * 1.3).cos(), (turn * 0.31).sin());
            let rotation_rad = direction.normalize() * (turn * 1.0e-4 * 1.57);
            let mut state = DeviceState::HOME;
            state.pose = Pose::new(DVec3::ZERO, orientation_from_rotation_vector(rotation_rad));
            assert_eq!(wall.push(&state), wall.push_outside(&state), "{rotation_rad}");
        }
    }

    /// Force of the wall half a millimetre deep in it at a device and a rate, N.
    fn push_n(device: &Capabilities, rate_hz: u64) -> f64 {
        let wall = BoundaryWall::new(&Boundary::default(), device, 1_000_000_000 / rate_hz);
        let mut state = DeviceState::HOME;
        state.pose = Pose::new(DVec3::Z * 0.012, DeviceState::HOME.pose.orientation());
        wall.push(&state).map_or(0.0, |push| -push.force().z)
    }

    #[test]
    fn the_wall_is_as_stiff_as_device_and_rate_allow() {
        let is = |found: f64, n: f64| assert!((found - n).abs() < 1.0e-9, "{found} is not {n}");
        is(push_n(&CAPABILITIES, 1000), 5.0); // the default's 10 kN/m
        is(push_n(&CAPABILITIES, 100), 0.75); // 15 N s/m / 10 ms
        is(push_n(&Capabilities { max_stiffness_n_per_m: 450.0, ..CAPABILITIES }, 1000), 0.225);
        is(push_n(&Capabilities { max_stiffness_n_per_m: 0.0, ..CAPABILITIES }, 1000), 5.0); // says nothing
    }

    const CAPABILITIES: Capabilities = Capabilities {
        sensed: flotor_hal::Axes::ALL,
        actuated: flotor_hal::Axes::ALL,
        range_m: [0.012; 3],
        range_rad: [0.12; 3],
        resolution_m: 0.0,
        max_force_n: [40.0; 3],
        max_torque_nm: [5.0; 3],
        max_force_slew_n_per_s: f64::INFINITY,
        max_torque_slew_nm_per_s: f64::INFINITY,
        max_stiffness_n_per_m: 25_000.0,
        rate_hz: [100.0, 10_000.0],
        latency_s: 0.0,
    };
}
