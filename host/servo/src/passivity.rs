//! The envelope's stage for energy: the energy balance of a device's port, and the passivity controller that a scene
//! may add.
//!
//! What crosses a port and how the controller removes it: [`flotor_coupling::port_energy`].

use flotor_core::coupling::PassivityMode;
use flotor_coupling::port_energy::{Controller, Expected, PortObserver};
use flotor_hal::{DVec3, DeviceState, Twist, Wrench};

/// Accelerations that a handle may have without its next sample being a surprise: 40 N on 0.58 kg are 69 m/s², and
/// a hand in between takes most of it; for rotation the same at a lever of a tenth of a metre.
const EXPECTED: Expected = Expected { acceleration_m_per_s2: 50.0, acceleration_rad_per_s2: 500.0 };

/// Watches, and on request guards, the energy at one port.
pub(super) struct Passivity {
    mode: PassivityMode,
    observer: PortObserver,
    controller: Controller,
    /// 1 for each axis of force and torque that is driven, 0 for the others.
    driven: [DVec3; 2],
    energy_j: f64,
}

impl Passivity {
    /// For a port at which at most this force and torque may be sent. Not real-time.
    pub(super) fn new(mode: PassivityMode, controller: Controller, most: [DVec3; 2]) -> Self {
        let driven = most.map(|most| DVec3::select(most.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::ZERO));
        Self { mode, observer: PortObserver::default(), controller, driven, energy_j: 0.0 }
    }

    /// Books what has crossed the port since the last sample, while `held` was applied. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn observe(&mut self, state: &DeviceState, held: &Wrench) {
        self.energy_j += self.observer.gone_in_j(&state.pose, held);
    }

    /// Energy the hand has put into the port so far less what has come out, J. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// The wrench with as much taken away as it takes to keep the energy from becoming negative by the next sample,
    /// if that is anything. Only motion along driven axes counts: along the others nothing can be damped, and damping
    /// that was counted on there would be missed.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn guard(&self, wrench: &Wrench, state: &DeviceState) -> Option<Wrench> {
        match self.mode {
            PassivityMode::Observe => None,
            PassivityMode::Control => {
                let [linear, angular] = self.driven;
                let slowed = Twist::new(state.twist.linear() * linear, state.twist.angular() * angular);
                self.controller.keep_within(self.energy_j, wrench, &slowed, EXPECTED)
            }
        }
    }
}

#[cfg(test)]
mod tests;
