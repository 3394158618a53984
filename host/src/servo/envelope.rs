//! The envelope: what stands between models and device, and what nothing gets past.
//!
//! Order: guard (a number that is not finite becomes zero) -> start-up ramp -> boundary wall -> force and
//! torque limits -> slew limit. The slew limit is last, so that no fault upstream, not even a model that
//! vanishes, makes the force jump; the limits hold after it too, because the limited region is convex and the
//! slew limit only moves along the line from the last wrench, which was inside, to the new one, which is.

use crate::scene::{Boundary, Limits};
use crate::trace::Events;
use flotor_hal::{Capabilities, DVec3, DeviceState, Tick, Wrench, rotation_vector};

/// Limits of force, torque and their change, and a wall at the edge of the range.
pub struct Envelope {
    max_force_n: DVec3,
    max_torque_nm: DVec3,
    force_slew_n_per_s: f64,
    torque_slew_nm_per_s: f64,
    ramp_ns: f64,
    boundary: Boundary,
    wall_m: DVec3,
    wall_rad: DVec3,
    period_ns: u64,
    last: Wrench,
}

impl Envelope {
    /// Combines what the scene allows with what the device declares; the tighter wins. Not real-time.
    #[must_use]
    pub fn new(limits: &Limits, boundary: &Boundary, device: &Capabilities, period_ns: u64) -> Self {
        let tighter =
            |scene: [f64; 3], device: [f64; 3]| DVec3::from_array(scene).min(DVec3::from_array(device));
        let inside = |range: [f64; 3], margin: f64| (DVec3::from_array(range) - margin).max(DVec3::ZERO);
        Self {
            max_force_n: tighter(limits.force_n, device.max_force_n),
            max_torque_nm: tighter(limits.torque_nm, device.max_torque_nm),
            force_slew_n_per_s: limits.force_slew_n_per_s.min(device.max_force_slew_n_per_s),
            torque_slew_nm_per_s: limits.torque_slew_nm_per_s.min(device.max_torque_slew_nm_per_s),
            ramp_ns: limits.ramp_s * 1.0e9,
            boundary: *boundary,
            wall_m: inside(device.range_m, boundary.margin_m),
            wall_rad: inside(device.range_rad, boundary.margin_rad),
            period_ns,
            last: Wrench::ZERO,
        }
    }

    /// The wrench that goes to the device for what the models ask. Real-time: bounded, no allocation.
    #[inline]
    pub fn apply(
        &mut self,
        request: &Wrench,
        state: &DeviceState,
        tick: &Tick,
        events: &mut Events,
    ) -> Wrench {
        let guarded = if request.is_finite() {
            *request
        } else {
            events.insert(Events::NOT_FINITE);
            Wrench::ZERO
        };
        let ramped = guarded * self.ramp(tick, events);
        let walled = ramped + self.wall(state, events);
        let limited = self.limit(&walled, events);
        let safe = self.slew(&limited, tick, events);
        self.last = safe;
        safe
    }

    /// Fades in from 0 to 1 with zero slope at both ends.
    fn ramp(&self, tick: &Tick, events: &mut Events) -> f64 {
        #[allow(clippy::cast_precision_loss)] // 2^53 ns are 104 days
        let time_ns = tick.time_ns as f64;
        if time_ns >= self.ramp_ns {
            return 1.0;
        }
        events.insert(Events::RAMPING);
        let part = time_ns / self.ramp_ns;
        part * part * (3.0 - 2.0 * part)
    }

    /// Spring and damper that push back what has left the range. Zero inside.
    fn wall(&self, state: &DeviceState, events: &mut Events) -> Wrench {
        if !state.is_finite() {
            return Wrench::ZERO;
        }
        let Boundary {
            stiffness_n_per_m, damping_ns_per_m, stiffness_nm_per_rad, damping_nms_per_rad, ..
        } = self.boundary;
        let (position_m, velocity) = (state.pose.position(), state.twist.linear());
        let force = wall(position_m, velocity, self.wall_m, stiffness_n_per_m, damping_ns_per_m);
        let (rotation_rad, spin) = (rotation_vector(state.pose.orientation()), state.twist.angular());
        let torque = wall(rotation_rad, spin, self.wall_rad, stiffness_nm_per_rad, damping_nms_per_rad);
        if force.is_none() && torque.is_none() {
            return Wrench::ZERO;
        }
        events.insert(Events::BOUNDARY);
        Wrench::new(force.unwrap_or(DVec3::ZERO), torque.unwrap_or(DVec3::ZERO))
    }

    fn limit(&self, wrench: &Wrench, events: &mut Events) -> Wrench {
        let force = shrink_into_box(wrench.force(), self.max_force_n);
        let torque = shrink_into_box(wrench.torque(), self.max_torque_nm);
        if force != wrench.force() {
            events.insert(Events::FORCE_LIMITED);
        }
        if torque != wrench.torque() {
            events.insert(Events::TORQUE_LIMITED);
        }
        Wrench::new(force, torque)
    }

    fn slew(&self, wrench: &Wrench, tick: &Tick, events: &mut Events) -> Wrench {
        // A tick after missed ones may change no more than one on time: the hand felt nothing in between.
        #[allow(clippy::cast_precision_loss)] // a period is far below 2^53 ns
        let period_s = tick.dt_ns.min(self.period_ns).max(1) as f64 * 1.0e-9;
        let period_s = if tick.dt_ns == 0 { self.period_ns as f64 * 1.0e-9 } else { period_s };
        let force = move_towards(self.last.force(), wrench.force(), self.force_slew_n_per_s * period_s);
        let torque = move_towards(self.last.torque(), wrench.torque(), self.torque_slew_nm_per_s * period_s);
        let slewed = Wrench::new(force, torque);
        if slewed != *wrench {
            events.insert(Events::SLEW_LIMITED);
        }
        slewed
    }
}

/// Spring and damper along the ray from the centre, outside an ellipsoid (a sphere for equal ranges: the thesis's
/// boundary, section 3.2); `None` inside. Damping acts outwards only: the wall never pulls.
fn wall(at: DVec3, velocity: DVec3, semi_axes: DVec3, stiffness: f64, damping: f64) -> Option<DVec3> {
    let beyond = (at / semi_axes).length();
    // A range of zero gives 0/0 at the centre, which is inside: an axis that cannot move needs no wall.
    if beyond.is_nan() || beyond <= 1.0 {
        return None;
    }
    let distance = at.length();
    let outward = at / distance;
    let depth = distance - distance / beyond;
    let push = (stiffness * depth + damping * velocity.dot(outward).max(0.0)).max(0.0);
    Some(outward * -push)
}

/// The longest vector of the same direction inside the box, not longer than `vector`.
fn shrink_into_box(vector: DVec3, half_sides: DVec3) -> DVec3 {
    let excess = (vector.abs() / half_sides).max_element();
    // A half side of zero makes the ratio infinite (or 0/0, NaN, for a zero component): nothing is allowed then.
    if excess <= 1.0 { vector } else { (vector / excess).clamp(-half_sides, half_sides) }
}

/// From `from` towards `to`, by `step` at most.
fn move_towards(from: DVec3, to: DVec3, step: f64) -> DVec3 {
    let way = to - from;
    let length = way.length();
    if length <= step { to } else { from + way * (step / length) }
}
