//! Safety envelope: the stages between models and device that every command passes.
//!
//! Order: guard (a wrench with a non-finite number becomes zero) -> gate (the start-up ramp and the other [states of the
//! run](flotor_core::run_state)) -> velocity limit -> [boundary wall](flotor_core::boundary_wall) -> force and torque limits -> [damping of an
//! oscillation](flotor_core::oscillation) -> [passivity](flotor_coupling::passivity), and the limits once more if the controller has changed
//! the wrench -> slew limit.
//!
//! The [slew limit](flotor_coupling::slew) is last, so that no fault upstream, not even the loss of a model, makes the force jump; only the force
//! component that accelerates the handle may fall faster. The limits hold after the slew limit too: a wrench that it has changed is
//! limited to the [regions](flotor_core::region) once more.

use flotor_core::boundary_wall::BoundaryWall;
use flotor_core::grip::GripRecord;
use flotor_core::grip_guard::GripGuard;
use flotor_core::limits::{Bound, Boundary, Limits};
use flotor_core::oscillation::Oscillation;
use flotor_core::region::Region;
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_core::run_state::Gate;
use flotor_core::trace::Events;
use flotor_coupling::passivity::Passivity;
use flotor_coupling::port_energy::{Controller, PortObserver};
use flotor_coupling::slew::SlewLimit;
use flotor_hal::{Capabilities, DVec3, DeviceState, GripAxis, Tick, Twist, Wrench};

/// Effect of a stage of the envelope over a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageEffect {
    /// Total time of the ticks in which the stage changed the wrench, ns.
    pub active_ns: u64,
    /// Work done on the hand by the stage's change of the wrench, J; negative: the stage removed energy.
    pub work_j: f64,
}

/// Effects of the passivity controller and the slew limit over a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvelopeEffects {
    /// Effect of the passivity controller.
    pub passivity: StageEffect,
    /// Effect of the slew limit.
    pub slew: StageEffect,
}

/// Safety envelope of one device: limits of force, torque, velocity and slew rate, boundary wall, damping of oscillations, and
/// passivity controller.
#[derive(Clone)]
pub struct Envelope {
    /// Limit of the force, N.
    force: Region,
    /// Limit of the torque, N·m.
    torque: Region,
    /// Velocity above which the force component along the velocity is scaled down, m/s.
    velocity: Region,
    /// Angular velocity above which the torque component along the angular velocity is scaled down, rad/s.
    spin: Region,
    slew: SlewLimit,
    wall: BoundaryWall,
    motion: PortObserver,
    passivity: Passivity,
    effects: EnvelopeEffects,
    oscillation: Oscillation,
    period_ns: u64,
    last: Wrench,
    /// Limits of the grip; `None` for a device without one.
    pub(super) grip: Option<GripGuard>,
}

impl Envelope {
    /// Creates the envelope from the limits of scene and device, of which the tighter apply, for ticks of `period_ns`. Not real-time.
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
            slew: SlewLimit::new(limits, device),
            wall: BoundaryWall::new(&RenderedBoundary::new(boundary, device, &force_n, period_ns)),
            // The device is known to be stable with the damping of its boundary.
            passivity: Passivity::new(
                limits.passivity,
                Controller::new(
                    boundary.damping_ns_per_m,
                    boundary.damping_nms_per_rad,
                    period_ns as f64 * 1.0e-9,
                ),
                most,
            ),
            motion: PortObserver::default(),
            effects: EnvelopeEffects::default(),
            oscillation: Oscillation::NONE,
            period_ns,
            last: Wrench::ZERO,
            grip: None,
        }
    }

    /// Adds the limits of a declared grip under the limits of a scene. Not real-time.
    pub fn with_grip(self, grip: Option<GripAxis>, limits: &Limits) -> Self {
        Self { grip: grip.map(|axis| GripGuard::new(axis, limits)), ..self }
    }

    /// Returns the limits of force (N) and torque (N·m) at the hand: the tighter limits of scene and device.
    pub fn most(&self) -> [Bound; 2] {
        [self.force.bound(), self.torque.bound()]
    }

    /// Passes the requested wrench through all stages; returns the wrench to command, device frame, and adds the events of the
    /// stages that acted. Also records the energy since the last sample: call this function once per tick. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub fn apply(
        &mut self,
        request: &Wrench,
        gate: Gate,
        state: &DeviceState,
        tick: &Tick,
        events: &mut Events,
    ) -> Wrench {
        self.observe(state);
        let guarded = guard(request, events);
        let gated = guarded * gate.models;
        let driven = self.limit_velocity(gated, state, events);
        let walled = self.add_boundary(driven, gate, state, events);
        // Before passivity: an unlimited wrench may be too large to be squared.
        let bounded = self.limit_wrench(walled, events);
        let calmed = self.limit_oscillation(bounded, state, tick, events);
        let passive = self.limit_energy(calmed, state, tick, events);
        let sent = self.limit_slew(passive, &state.twist, tick, events);
        self.last = sent;
        sent
    }

    /// Passes the models' effort at a grip through its limits and stores the effort to command. Real-time: bounded, no allocation.
    #[inline(never)] // few devices have one
    pub fn apply_grip(&mut self, grip: &mut GripRecord, gate: Gate, tick: &Tick, events: &mut Events) {
        let dt_s = self.slew_time_ns(tick) as f64 * 1.0e-9;
        grip.commanded =
            self.grip.as_mut().map_or(0.0, |guard| guard.limit(grip.model, gate.models, dt_s, events));
    }

    /// Returns the energy that the hand has put into the device's port less the energy that it received, J; negative: the loop has
    /// generated energy. Real-time: bounded, no allocation.
    #[must_use]
    pub fn port_energy_j(&self) -> f64 {
        self.passivity.energy_j()
    }

    /// Returns the effects of the passivity controller and the slew limit so far. Real-time: bounded, no allocation.
    #[must_use]
    pub fn effects(&self) -> EnvelopeEffects {
        self.effects
    }

    /// Records the energy that crossed the port since the last sample.
    #[inline]
    fn observe(&mut self, state: &DeviceState) {
        let moved = self.motion.moved(&state.pose);
        self.effects.passivity.work_j -= self.passivity.observe(&moved, &self.last);
        self.effects.slew.work_j += self.slew.observe(&moved, &self.last);
    }

    /// Returns true if the force oscillated between its limits even after damping: the run has to end. Real-time: bounded, no allocation.
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

    /// Adds the wrench of the boundary wall.
    #[inline]
    fn add_boundary(&self, wrench: Wrench, gate: Gate, state: &DeviceState, events: &mut Events) -> Wrench {
        let Some(push) = self.wall.push(state) else { return wrench };
        events.insert(Events::BOUNDARY);
        wrench + push * gate.boundary
    }

    /// Scales force and torque down into their limits.
    #[inline(always)] // 3 ns: the wrench stays in registers
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

    /// Scales the wrench down while the force or torque oscillates between its limits.
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

    /// Reduces or damps a wrench that would take more energy from the port than it has, if the scene enables the passivity controller.
    #[inline]
    fn limit_energy(
        &mut self,
        wrench: Wrench,
        state: &DeviceState,
        tick: &Tick,
        events: &mut Events,
    ) -> Wrench {
        let Some(damped) = self.passivity.limit(&wrench, &self.last, state) else { return wrench };
        events.insert(Events::PASSIVITY_DAMPED);
        self.effects.passivity.active_ns += self.slew_time_ns(tick);
        // Damping may exceed the limit of an axis.
        self.limit_wrench(damped, events)
    }

    /// Limits the change of force and torque since the last tick.
    #[inline]
    fn limit_slew(&mut self, wrench: Wrench, twist: &Twist, tick: &Tick, events: &mut Events) -> Wrench {
        let dt_ns = self.slew_time_ns(tick);
        let regions = [&self.force, &self.torque];
        let limited = self.slew.limit(&wrench, &self.last, twist, dt_ns as f64 * 1.0e-9, regions);
        let Some(limited) = limited else { return wrench };
        events.insert(Events::SLEW_LIMITED);
        self.effects.slew.active_ns += dt_ns;
        // Rounding may leave the region.
        Wrench::new(self.force.shrink(limited.force()), self.torque.shrink(limited.torque()))
    }

    /// Returns the time for which the slew limit allows a change, ns: at most one period even after missed ticks, because the
    /// wrench was constant in between.
    #[inline]
    fn slew_time_ns(&self, tick: &Tick) -> u64 {
        if tick.dt_ns == 0 { self.period_ns } else { tick.dt_ns.min(self.period_ns) }
    }
}

/// Replaces a non-finite wrench with zero.
#[inline]
fn guard(request: &Wrench, events: &mut Events) -> Wrench {
    if request.is_finite() {
        return *request;
    }
    events.insert(Events::NOT_FINITE);
    Wrench::ZERO
}

/// Reduces the force component along the velocity if it accelerates the handle: in full up to an excess of 1, then linearly down to
/// zero at 2. Returns zero for a force too large to be split into components without overflow.
fn without_drive(force: DVec3, velocity: DVec3, excess: f64) -> DVec3 {
    let along = velocity.normalize_or_zero();
    let drive = force.dot(along).max(0.0);
    let left = force - along * (drive * (excess - 1.0).clamp(0.0, 1.0));
    if left.is_finite() { left } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests;
