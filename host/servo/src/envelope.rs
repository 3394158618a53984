//! The envelope: what stands between models and device, and what nothing gets past.
//!
//! Order: guard (a number that is not finite becomes zero) -> gate (the start-up ramp and the other
//! [states of the run](super::state)) -> velocity limit -> [boundary wall](super::boundary) -> force and torque limits
//! -> [damping of an oscillation](flotor_core::oscillation) -> [passivity](super::passivity), and the limits once more if it took something
//! away -> slew limit.
//!
//! The slew limit is last, so that no fault upstream, not even a model that vanishes, makes the force jump; the limits
//! hold after it too, because the limited [regions](region) are convex and the slew limit only moves along the line from the
//! last wrench, which was inside, to the new one, which is.

mod region;

use super::boundary::BoundaryWall;
use super::passivity::Passivity;
use super::state::Gate;
use flotor_core::limits::{Bound, Boundary, Limits};
use flotor_core::oscillation::Oscillation;
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_core::trace::Events;
use flotor_coupling::port_energy::Controller;
use flotor_hal::{Capabilities, DVec3, DeviceState, Tick, Wrench};
use region::Region;

/// Limits of force, torque and their change, and a wall at the edge of the range.
pub struct Envelope {
    /// The most that may be sent, N and N·m.
    force: Region,
    torque: Region,
    /// Velocity (m/s, rad/s) above which force components along it are scaled down.
    velocity: Region,
    spin: Region,
    /// Fastest change of force (N/s) and torque (N·m/s), as norms.
    slew_per_s: [f64; 2],
    wall: BoundaryWall,
    passivity: Passivity,
    oscillation: Oscillation,
    period_ns: u64,
    last: Wrench,
}

impl Envelope {
    /// Combines what the scene allows with what the device declares; the tighter wins. Not real-time.
    #[must_use]
    pub fn new(limits: &Limits, boundary: &Boundary, device: &Capabilities, period_ns: u64) -> Self {
        let force_n = limits.force_n.and(Bound::box_of(device.max_force_n));
        let torque_nm = limits.torque_nm.and(Bound::box_of(device.max_torque_nm));
        let most = [force_n, torque_nm].map(|bound| DVec3::from_array(bound.axes()));
        Self {
            force: Region::of(force_n),
            torque: Region::of(torque_nm),
            velocity: Region::of(limits.velocity_m_per_s),
            spin: Region::of(limits.angular_velocity_rad_per_s),
            slew_per_s: [
                limits.force_slew_n_per_s.min(device.max_force_slew_n_per_s),
                limits.torque_slew_nm_per_s.min(device.max_torque_slew_nm_per_s),
            ],
            wall: BoundaryWall::new(&RenderedBoundary::new(boundary, device, &force_n, period_ns)),
            // Damping the device is known to stand: that of its boundary.
            passivity: Passivity::new(
                limits.passivity,
                Controller {
                    damping_ns_per_m: boundary.damping_ns_per_m,
                    damping_nms_per_rad: boundary.damping_nms_per_rad,
                    period_s: period_ns as f64 * 1.0e-9,
                },
                most,
            ),
            oscillation: Oscillation::NONE,
            period_ns,
            last: Wrench::ZERO,
        }
    }

    /// The most that may reach the hand: force (N), torque (N·m).
    #[must_use]
    pub fn most(&self) -> [Bound; 2] {
        [self.force.bound(), self.torque.bound()]
    }

    /// The wrench that goes to the device for what the models ask. Real-time: bounded, no allocation.
    #[inline]
    pub fn apply(
        &mut self,
        request: &Wrench,
        gate: Gate,
        state: &DeviceState,
        tick: &Tick,
        events: &mut Events,
    ) -> Wrench {
        self.passivity.observe(state, &self.last);
        let guarded = guard(request, events);
        let gated = guarded * gate.models;
        let driven = self.limit_velocity(gated, state, events);
        let walled = self.add_boundary(driven, gate, state, events);
        // Before passivity: what cannot be sent anyway may be too large to be squared.
        let bounded = self.limit_wrench(walled, events);
        let calmed = self.limit_oscillation(bounded, state, tick, events);
        let passive = self.limit_energy(calmed, state, events);
        let sent = self.limit_slew(passive, tick, events);
        self.last = sent;
        sent
    }

    /// Energy the hand has put into the device's port so far less what has come out, J; negative: the loop has created
    /// energy. Real-time: bounded, no allocation.
    #[must_use]
    pub fn port_energy_j(&self) -> f64 {
        self.passivity.energy_j()
    }

    /// Whether the force swung between its limits and went on when it was damped: the run has to end. Real-time: bounded, no
    /// allocation.
    #[inline]
    #[must_use]
    pub fn is_unstable(&self) -> bool {
        self.oscillation.is_given_up()
    }

    /// Scales force components along the velocity down above the velocity limit, linearly to zero at twice the limit;
    /// components against it pass.
    #[inline]
    fn limit_velocity(&self, wrench: Wrench, state: &DeviceState, events: &mut Events) -> Wrench {
        let (velocity, spin) = (state.twist.linear(), state.twist.angular());
        if self.velocity.holds(velocity) && self.spin.holds(spin) {
            return wrench;
        }
        events.insert(Events::VELOCITY_LIMITED);
        let (excess, spin_excess) = (self.velocity.excess(velocity), self.spin.excess(spin));
        Wrench::new(
            without_drive(wrench.force(), velocity, excess),
            without_drive(wrench.torque(), spin, spin_excess),
        )
    }

    /// Adds the push of the boundary wall.
    #[inline]
    fn add_boundary(&self, wrench: Wrench, gate: Gate, state: &DeviceState, events: &mut Events) -> Wrench {
        let Some(push) = self.wall.push(state) else { return wrench };
        events.insert(Events::BOUNDARY);
        wrench + push * gate.boundary
    }

    /// Scales force and torque down into their limits.
    #[inline(always)] // 3 ns: its wrench stays in registers
    fn limit_wrench(&self, wrench: Wrench, events: &mut Events) -> Wrench {
        if self.force.holds(wrench.force()) && self.torque.holds(wrench.torque()) {
            return wrench;
        }
        let (force, torque) = (self.force.shrink(wrench.force()), self.torque.shrink(wrench.torque()));
        if self.force.has_cut(wrench.force(), force) {
            events.insert(Events::FORCE_LIMITED);
        }
        if self.torque.has_cut(wrench.torque(), torque) {
            events.insert(Events::TORQUE_LIMITED);
        }
        Wrench::new(force, torque)
    }

    /// Lets a part of the force through while it swings between its limits.
    #[inline]
    fn limit_oscillation(
        &mut self,
        bounded: Wrench,
        state: &DeviceState,
        tick: &Tick,
        events: &mut Events,
    ) -> Wrench {
        let cut = [Events::FORCE_LIMITED, Events::TORQUE_LIMITED].map(|cut| events.intersects(cut));
        if cut != [false; 2] {
            self.oscillation.note(&bounded, cut, &state.pose, tick.time_ns);
        }
        let Some(gain) = self.oscillation.gain(tick.time_ns) else { return bounded };
        events.insert(Events::OSCILLATION_DAMPED);
        bounded * gain
    }

    /// Takes away what would bring out more energy than there is, if the scene asks for that.
    #[inline]
    fn limit_energy(&self, wrench: Wrench, state: &DeviceState, events: &mut Events) -> Wrench {
        let Some(damped) = self.passivity.guard(&wrench, state) else { return wrench };
        events.insert(Events::PASSIVITY_DAMPED);
        // Damping may be more than an axis can give.
        self.limit_wrench(damped, events)
    }

    /// Moves force and torque from those of the last tick no farther than the slew limit allows. A tick after missed ones
    /// may change them no more than one on time: the hand felt nothing in between.
    #[inline]
    fn limit_slew(&self, wrench: Wrench, tick: &Tick, events: &mut Events) -> Wrench {
        let dt_ns = if tick.dt_ns == 0 { self.period_ns } else { tick.dt_ns.min(self.period_ns) };
        let dt_s = dt_ns as f64 * 1.0e-9;
        let [force_n, torque_nm] = self.slew_per_s.map(|per_s| per_s * dt_s);
        let force = step_short_of(self.last.force(), wrench.force(), force_n);
        let torque = step_short_of(self.last.torque(), wrench.torque(), torque_nm);
        if force.is_some() || torque.is_some() {
            events.insert(Events::SLEW_LIMITED);
        }
        // A rounding on the way may leave the region.
        Wrench::new(
            force.map_or(wrench.force(), |force| self.force.shrink(force)),
            torque.map_or(wrench.torque(), |torque| self.torque.shrink(torque)),
        )
    }
}

/// A wrench that is not finite becomes none.
#[inline]
fn guard(request: &Wrench, events: &mut Events) -> Wrench {
    if request.is_finite() {
        return *request;
    }
    events.insert(Events::NOT_FINITE);
    Wrench::ZERO
}

/// A force without the part along the velocity that adds to it, which fades from all at an excess of 1 to nothing at 2. A
/// request near the largest double that cannot be split is no force.
fn without_drive(force: DVec3, velocity: DVec3, excess: f64) -> DVec3 {
    let along = velocity.normalize_or_zero();
    let drive = force.dot(along).max(0.0);
    let left = force - along * (drive * (excess - 1.0).clamp(0.0, 1.0));
    if left.is_finite() { left } else { DVec3::ZERO }
}

/// The point `most` from `from` on the way to `to`; `None` if `to` is no farther than that.
fn step_short_of(from: DVec3, to: DVec3, most: f64) -> Option<DVec3> {
    let way = to - from;
    if way.length_squared() <= most * most {
        return None;
    }
    Some(from + way * (most / way.length()))
}

#[cfg(test)]
mod tests;
