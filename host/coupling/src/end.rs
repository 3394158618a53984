//! One end of a coupling: a spring and a damper pull its handle to the last known position of the partner.

use super::brake::Brake;
use super::{CouplingConfig, PassivityMode, Pull, Tank};
use crate::port_energy::{Controller, PortObserver};
use flotor_core::mapping::{Mapping, MappingConfig};
use flotor_core::peer::PeerState;
use flotor_hal::{DVec3, DeviceState, Pose, Wrench, rotation_vector};

/// Energy of the tank that is held in reserve, J: the energy of an unexpected motion of 20 µm at 1 N. With this
/// reserve, a hand that starts faster than expected does not take the tank below zero.
const SURPRISE_J: f64 = 2.0e-5;

/// Fraction of the available energy that a tick may take: a force that drains the tank decays over ten ticks or more,
/// instead of one.
const DRAWN: f64 = 0.1;
/// Time over which a force that was reduced for lack of energy returns, s. Returning at once, it would drain the tank
/// again in the next tick, and switch on and off from tick to tick: the hand feels a rattle.
const RETURN_S: f64 = 0.1;

/// Local end of a coupling: virtual spring and damper at one device, limited by an energy tank.
#[derive(Clone)]
pub struct End {
    config: CouplingConfig,
    /// Mapping from the device's frame to the shared frame.
    pub(super) mapping: Mapping,
    observer: PortObserver,
    controller: Controller,
    /// Energy tank of this end, shared frame.
    pub(super) tank: Tank,
    bounce: Bounce,
    partner: Option<PeerState>,
    /// Fraction of the requested wrench, 0 to 1: below one after the tank was too low.
    part: f64,
}

impl End {
    /// Creates an end with an empty tank and without a peer state; until it receives a peer state, it requests no
    /// force. Not real-time.
    ///
    /// `mapping` maps from the device's frame to the shared frame; `period_s` is the time between ticks.
    #[must_use]
    pub fn new(config: &CouplingConfig, mapping: &MappingConfig, period_s: f64) -> Self {
        let mapping = Mapping::new(mapping);
        // The damping of the coupling, as the hand feels it, which the pair of devices can render.
        let controller = Controller::new(
            config.damping_ns_per_m * mapping.stiffness_scale(),
            config.damping_nms_per_rad * mapping.energy_scale(),
            period_s,
        );
        Self {
            config: *config,
            mapping,
            observer: PortObserver::default(),
            controller,
            tank: Tank::default(),
            bounce: Bounce::default(),
            partner: None,
            part: 1.0,
        }
    }

    /// Adds the energy that has crossed the port since the last tick to the tank; `held` is the wrench applied
    /// meanwhile (state and wrench in the device frame). Call once per tick, first.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn observe(&mut self, state: &DeviceState, held: &Wrench) {
        let gone_in_j = self.observer.gone_in_j(&state.pose, held);
        self.tank.book(gone_in_j / self.mapping.energy_scale());
        self.bounce.follow(&state.pose, held);
        self.controller.follow(&state.twist);
    }

    /// Passes a fraction of the energy in the tank, without the energy stored in walls, on to the partner; returns the
    /// state for the partner, shared frame. Call once per tick. Real-time: bounded, no allocation.
    #[inline]
    pub fn send_state(&mut self, state: &DeviceState) -> PeerState {
        let passed_on_j = self.tank.pass_on(self.bounce_j());
        self.peer_state(state, passed_on_j)
    }

    /// Returns the state for a partner that may not be connected, and passes no energy on. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn call(&self, state: &DeviceState) -> PeerState {
        self.peer_state(state, self.tank.passed_on_j)
    }

    #[inline]
    fn peer_state(&self, state: &DeviceState, passed_on_j: f64) -> PeerState {
        PeerState {
            pose: self.mapping.pose_to_model(&state.pose),
            twist: self.mapping.twist_to_model(&state.twist),
            passed_on_j,
        }
    }

    /// Stores the newest peer state and adds the energy that the partner has passed on; states of earlier ticks may be
    /// missing. Real-time: bounded, no allocation.
    #[inline]
    pub fn receive(&mut self, peer: &PeerState) {
        self.tank.receive(peer.passed_on_j);
        self.partner = Some(*peer);
    }

    /// Returns the total energy passed on to the partner, J. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn passed_on_j(&self) -> f64 {
        self.tank.passed_on_j
    }

    /// Returns the wrench that this end requests, device frame; zero without a peer state. Discards energy in the tank
    /// above the needs of spring, reserve and walls; with [`PassivityMode::Control`], reduces the wrench to the
    /// available energy. Call once per tick. Real-time: bounded, no allocation.
    #[inline]
    pub fn pull(&mut self, state: &DeviceState) -> Pull {
        let pull = self.whole_pull(state);
        self.bounce.asked = pull.wrench;
        pull
    }

    /// Returns the fraction `part`, 0 to 1, of the pull, limited by the brake: this part takes no more energy than the
    /// whole pull. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn pull_part(&mut self, state: &DeviceState, part: f64, brake: &Brake) -> Pull {
        let whole = self.whole_pull(state);
        let pull = Pull { wrench: brake.braked(&(whole.wrench * part), state), ..whole };
        self.bounce.asked = pull.wrench;
        pull
    }

    /// Requests no force. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn release(&mut self) -> Pull {
        self.bounce.asked = Wrench::ZERO;
        Pull::default()
    }

    #[inline]
    fn whole_pull(&mut self, state: &DeviceState) -> Pull {
        let Some(partner) = &self.partner else { return Pull::default() };
        let (pose, twist) =
            (self.mapping.pose_to_model(&state.pose), self.mapping.twist_to_model(&state.twist));
        let away = partner.pose.position() - pose.position();
        let turned: DVec3 = rotation_vector(partner.pose.orientation() * pose.orientation().conjugate());
        let config = &self.config;
        // Spring and damper towards the partner, in the shared frame: F = k dx + b dv, T = k dphi + b dw.
        let force = away * config.stiffness_n_per_m
            + (partner.twist.linear() - twist.linear()) * config.damping_ns_per_m;
        let torque = turned * config.stiffness_nm_per_rad
            + (partner.twist.angular() - twist.angular()) * config.damping_nms_per_rad;
        let wrench = self.mapping.wrench_to_device(&Wrench::new(force, torque));
        let stored_j = 0.5
            * (config.stiffness_n_per_m * away.length_squared()
                + config.stiffness_nm_per_rad * turned.length_squared());
        self.tank.limit(stored_j + config.reserve_j + self.bounce_j());
        let scale = self.mapping.energy_scale();
        let given = match config.passivity {
            PassivityMode::Observe => wrench,
            PassivityMode::Control => self.affordable(&wrench, state),
        };
        Pull { wrench: given, energy_j: 0.5 * stored_j * scale, is_damped: given != wrench }
    }

    /// Reduces a wrench to the energy in the tank, and to the fraction that has returned so far.
    #[inline]
    fn affordable(&mut self, whole: &Wrench, state: &DeviceState) -> Wrench {
        let part = (self.part + self.controller.period_s() / RETURN_S).min(1.0);
        let asked = *whole * part;
        let available_j = DRAWN * (self.tank.level_j() - SURPRISE_J) * self.mapping.energy_scale();
        let less = self.controller.keep_within(available_j, &asked, &self.bounce.asked, &state.twist);
        self.part = less.map_or(part, |less| part * part_along(&less, &asked));
        less.unwrap_or(asked)
    }

    /// Returns the energy stored in walls, J, in the shared frame.
    #[inline]
    fn bounce_j(&self) -> f64 {
        self.bounce.stored_j / self.mapping.energy_scale()
    }
}

/// Returns the component of a reduced wrench along the whole wrench, as a fraction of the whole, 0 to 1; the smaller
/// fraction of force and torque.
#[inline]
fn part_along(less: &Wrench, whole: &Wrench) -> f64 {
    let of = |less: DVec3, whole: DVec3| {
        let square = whole.length_squared();
        if square > 0.0 { (less.dot(whole) / square).clamp(0.0, 1.0) } else { 1.0 }
    };
    of(less.force(), whole.force()).min(of(less.torque(), whole.torque()))
}

/// Energy stored in springs other than the coupling's, namely the walls at the boundary. It will return to the hand at
/// this end, and must not be passed on before.
#[derive(Clone, Copy, Debug, Default)]
struct Bounce {
    observer: PortObserver,
    /// Wrench that the coupling requested last, device frame.
    asked: Wrench,
    /// Upper bound of the stored energy, J, scaled to the device.
    stored_j: f64,
}

impl Bounce {
    /// Rounding error of sums of forces, N; a tenth of this number for sums of torques, N·m.
    const NOTHING_N: f64 = 1.0e-9;

    /// Integrates the work of the wrench beyond the requested one; zero as long as there is no such wrench.
    #[inline]
    fn follow(&mut self, pose: &Pose, held: &Wrench) {
        let beyond = *held - self.asked;
        let gone_in_j = self.observer.gone_in_j(pose, &beyond);
        let is_nothing =
            beyond.force().length() < Self::NOTHING_N && beyond.torque().length() < 0.1 * Self::NOTHING_N;
        self.stored_j = if is_nothing { 0.0 } else { (self.stored_j + gone_in_j).max(0.0) };
    }
}
