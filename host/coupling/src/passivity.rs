//! Passivity stage of the envelope: the energy balance of a device's port, and the optional passivity controller.
//!
//! Port energy and the controller that ports and couplings share: [`crate::port_energy`].

use crate::port_energy::{Controller, Displacement};
use flotor_core::limits::PassivityMode;
use flotor_hal::{DVec3, DeviceState, Twist, Wrench};

/// Acceleration of a handle from rest that the reserve covers, m/s²: 40 N on 0.58 kg would give 69 m/s², but a hand takes most of
/// the force.
const RESERVE_ACCELERATION_M_PER_S2: f64 = 50.0;
/// Stiffness that the reserve covers, N/m.
const RESERVE_STIFFNESS_N_PER_M: f64 = 200.0;
/// Share of the reserve for motion as predicted; the rest covers a handle that starts faster than predicted.
const PREDICTED_SHARE: f64 = 0.5;

/// Returns the energy that the port may deliver beyond the energy received, J: the energy of a spring of 200 N/m over the distance
/// that a handle covers at 50 m/s² in a period, `K a² T⁴ / 8`. Without a reserve, an empty port could never exert a force. Not
/// real-time.
fn reserve_j(period_s: f64) -> f64 {
    let way_m = 0.5 * RESERVE_ACCELERATION_M_PER_S2 * period_s * period_s;
    0.5 * RESERVE_STIFFNESS_N_PER_M * way_m * way_m
}

/// Passivity observer of one port, with an optional passivity controller.
#[derive(Clone)]
pub struct Passivity {
    mode: PassivityMode,
    controller: Controller,
    /// Part of the reserve that the predicted motion may take, J.
    predicted_j: f64,
    /// Driven axes of force and torque: 1 for a driven axis, 0 for an axis without force or torque.
    driven: [DVec3; 2],
    energy_j: f64,
    /// Change of the last wrench by the controller.
    change: Option<Wrench>,
}

impl Passivity {
    /// Creates the stage for a port with the force and torque limits `most`, N and N·m. Not real-time.
    pub fn new(mode: PassivityMode, controller: Controller, most: [DVec3; 2]) -> Self {
        let driven = most.map(|most| DVec3::select(most.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::ZERO));
        let predicted_j = PREDICTED_SHARE * reserve_j(controller.period_s());
        Self { mode, controller, predicted_j, driven, energy_j: 0.0, change: None }
    }

    /// Records the displacement since the last sample, while `held` was applied; returns the energy that the controller removed
    /// from the port, J.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn observe(&mut self, moved: &Displacement, held: &Wrench) -> f64 {
        self.energy_j -= moved.work_j(held);
        self.change.take().map_or(0.0, |change| -moved.work_j(&change))
    }

    /// Returns the energy that the hand has put into the port less the energy that it received, J. Real-time: bounded, no allocation.
    #[inline]
    pub fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Returns a wrench with which the predicted motion takes no more energy than the port has, with the predicted share of the
    /// reserve; `None` if the wrench may pass unchanged. Only motion along driven axes counts: along an axis without drive no force can damp.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn limit(&mut self, wrench: &Wrench, held: &Wrench, state: &DeviceState) -> Option<Wrench> {
        match self.mode {
            PassivityMode::Observe => None,
            PassivityMode::Control => {
                let [linear, angular] = self.driven;
                let twist = Twist::new(state.twist.linear() * linear, state.twist.angular() * angular);
                self.controller.follow(&twist);
                let available_j = self.energy_j + self.predicted_j;
                let limited = self.controller.keep_within(available_j, wrench, held, &twist)?;
                self.change = Some(limited - *wrench);
                Some(limited)
            }
        }
    }
}

#[cfg(test)]
mod tests;
