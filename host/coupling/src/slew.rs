//! Slew limit, the last stage of the envelope: limits the change of force and torque from tick to tick.
//!
//! A limited force lags behind the requested force: it decelerates a moving handle too little, and would then push back with the
//! full requested force, which generates energy. Therefore the force component that accelerates the handle may fall as fast as the
//! device permits, and a ledger records the energy that the requested force would have taken from the hand, and how much less the
//! limited force took. Until the difference is recovered, a force along the motion is scaled by the ratio of the energy taken to
//! the energy requested, so that a spring returns exactly the energy that it received.

use crate::port_energy::Displacement;
use flotor_core::limits::Limits;
use flotor_core::region::Region;
use flotor_hal::{Capabilities, DVec3, Twist, Wrench};

/// Slew limit of a wrench, with the energy balances of force and torque.
#[derive(Clone)]
pub struct SlewLimit {
    force: Side,
    torque: Side,
    /// Last requested wrench; `None` if it was applied unchanged.
    requested: Option<Wrench>,
}

impl SlewLimit {
    /// Creates the limit from the slew rates of scene and device, of which the smaller apply. Not real-time.
    pub fn new(limits: &Limits, device: &Capabilities) -> Self {
        let side = |scene: f64, device: f64| Side {
            most_per_s: scene.min(device),
            most_fall_per_s: device,
            ledger: Ledger::SETTLED,
        };
        Self {
            force: side(limits.force_slew_n_per_s, device.max_force_slew_n_per_s),
            torque: side(limits.torque_slew_nm_per_s, device.max_torque_slew_nm_per_s),
            requested: None,
        }
    }

    /// Records the displacement since the last sample, while `held` was applied; returns the energy that the limit generated, J;
    /// negative: recovered.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn observe(&mut self, moved: &Displacement, held: &Wrench) -> f64 {
        if self.requested.is_none() && self.force.is_settled() && self.torque.is_settled() {
            return 0.0;
        }
        let requested = self.requested.unwrap_or(*held);
        self.force.ledger.book(requested.force(), held.force(), moved.linear)
            + self.torque.ledger.book(requested.torque(), held.torque(), moved.angular)
    }

    /// Moves force and torque from `held` towards the request, no farther in `dt_s` seconds than the limits allow, within the
    /// regions of both; `None` if the request may pass unchanged and no generated energy is outstanding. `held` and `request` are
    /// within the regions.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn limit(
        &mut self,
        request: &Wrench,
        held: &Wrench,
        twist: &Twist,
        dt_s: f64,
        regions: [&Region; 2],
    ) -> Option<Wrench> {
        let is_slow = self.force.allows(request.force(), held.force(), dt_s)
            && self.torque.allows(request.torque(), held.torque(), dt_s);
        if is_slow {
            self.requested = None;
            return None;
        }
        self.limit_fast(request, held, twist, dt_s, regions)
    }

    /// Limits a change that is too fast, or any change while generated energy is outstanding.
    #[cold]
    fn limit_fast(
        &mut self,
        request: &Wrench,
        held: &Wrench,
        twist: &Twist,
        dt_s: f64,
        [forces, torques]: [&Region; 2],
    ) -> Option<Wrench> {
        let force = self.force.limit(request.force(), held.force(), twist.linear(), dt_s, forces);
        let torque = self.torque.limit(request.torque(), held.torque(), twist.angular(), dt_s, torques);
        if force.is_none() && torque.is_none() {
            self.requested = None;
            return None;
        }
        self.requested = Some(*request);
        Some(Wrench::new(force.unwrap_or(request.force()), torque.unwrap_or(request.torque())))
    }
}

/// Slew limit of force or torque.
#[derive(Clone)]
struct Side {
    /// Maximum slew rate (norm of the change), N/s or N·m/s.
    most_per_s: f64,
    /// Maximum slew rate of the device, N/s or N·m/s: applies to a decrease of the component that accelerates the handle.
    most_fall_per_s: f64,
    ledger: Ledger,
}

impl Side {
    #[inline]
    fn is_settled(&self) -> bool {
        self.ledger.generated_j <= 0.0
    }

    /// Returns true if the change is slow enough and no generated energy is outstanding.
    #[inline]
    fn allows(&self, request: DVec3, held: DVec3, dt_s: f64) -> bool {
        let most = self.most_per_s * dt_s;
        self.is_settled() && (request - held).length_squared() <= most * most
    }

    fn limit(
        &self,
        request: DVec3,
        held: DVec3,
        velocity: DVec3,
        dt_s: f64,
        region: &Region,
    ) -> Option<DVec3> {
        if self.allows(request, held, dt_s) {
            return None;
        }
        let most = self.most_per_s * dt_s;
        let along = velocity.normalize_or_zero();
        let drive = request.dot(along).max(0.0);
        let allowed = drive * self.ledger.share();
        let target = request - along * (drive - allowed);
        let fallen = held - along * (held.dot(along) - allowed).max(0.0);
        // A force without its component along the motion may be outside the region; shrinking it is a decrease, too.
        let wanted = region.shrink(step_short_of(fallen, target, most).unwrap_or(target));
        let sent = step_short_of(held, wanted, self.most_fall_per_s * dt_s).unwrap_or(wanted);
        (sent != request).then_some(sent)
    }
}

/// Energy balance of a limit, reset when no generated energy is outstanding.
#[derive(Clone)]
struct Ledger {
    /// Energy that the requested force would have taken from the hand, J.
    requested_j: f64,
    /// Energy generated by the limit, J: the energy that the requested force would have taken from the hand, less the energy that
    /// the limited force took.
    generated_j: f64,
}

impl Ledger {
    /// Ledger without outstanding energy.
    const SETTLED: Self = Self { requested_j: 0.0, generated_j: 0.0 };

    /// Records a displacement; returns the energy that the limit generated over it, J.
    fn book(&mut self, requested: DVec3, held: DVec3, moved: DVec3) -> f64 {
        let generated_j = (held - requested).dot(moved);
        self.generated_j += generated_j;
        self.requested_j -= requested.dot(moved);
        if self.generated_j <= 0.0 {
            *self = Self::SETTLED;
        }
        generated_j
    }

    /// Returns the factor, 0 to 1, for a force along the motion with which the hand receives no more energy than the limited force took.
    fn share(&self) -> f64 {
        if self.generated_j <= 0.0 {
            return 1.0;
        }
        if self.requested_j > self.generated_j { 1.0 - self.generated_j / self.requested_j } else { 0.0 }
    }
}

/// Returns the point at distance `most` from `from` towards `to`; `None` if `to` is no farther.
fn step_short_of(from: DVec3, to: DVec3, most: f64) -> Option<DVec3> {
    let way = to - from;
    if way.length_squared() <= most * most {
        return None;
    }
    Some(from + way * (most / way.length()))
}

#[cfg(test)]
mod tests;
