//! Port of one device: its state, the request of models and couplings, and the command of a tick.

use flotor_core::ModelOutputs;
use flotor_core::demand::TickDemand;
use flotor_core::grip::GripRecord;
use flotor_core::trace::Events;
use flotor_coupling::Pull;
use flotor_hal::{DVec3, Demand, DeviceState, Wrench};

/// State of one device in a tick, device frame.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Last valid state of the handle.
    pub state: DeviceState,
    /// Wrench commanded to the device, applied until the next tick.
    pub commanded: Wrench,
    /// Grip of the device; `None` without one.
    pub grip: Option<GripRecord>,
    /// Model outputs that reach the hand at this device.
    pub(crate) at_hand: Demand,
    /// Model outputs computed in this tick.
    computed: Demand,
    /// Wrench requested by models and couplings, without the models' torque if the device exerts none.
    pub requested: Wrench,
    /// Part of `requested` from the models.
    pub(crate) by_models: Wrench,
    /// Torque of the models that does not reach the hand, N·m; computed for observers that request it.
    unfelt_torque_nm: DVec3,
    /// Energy stored in models and couplings, J, if computed.
    energy_j: f64,
    /// Events of this tick.
    pub events: Events,
}

impl Port {
    /// Creates a port at rest; the outputs `at_hand` reach the hand ([`flotor_core::demand::hand_demand`]).
    #[must_use]
    pub const fn at_rest(at_hand: Demand) -> Self {
        Self {
            state: DeviceState::HOME,
            commanded: Wrench::ZERO,
            grip: None,
            at_hand,
            computed: at_hand,
            requested: Wrench::ZERO,
            by_models: Wrench::ZERO,
            unfelt_torque_nm: DVec3::ZERO,
            energy_j: 0.0,
            events: Events::NONE,
        }
    }

    /// Returns the outputs of models and couplings in this tick. Real-time: bounded, no allocation.
    #[inline]
    pub fn outputs(&self) -> ModelOutputs {
        let Self { at_hand, computed, requested, unfelt_torque_nm, energy_j, .. } = self;
        let wrench = if at_hand.contains(Demand::TORQUE) {
            *requested
        } else {
            Wrench::new(requested.force(), requested.torque() + *unfelt_torque_nm)
        };
        ModelOutputs::new(wrench, *energy_j).limited_to(*computed)
    }

    /// Stores the request of the models; an output that only observers request is recorded, but not part of the request.
    #[inline]
    pub(crate) fn take(&mut self, demand: TickDemand, wrench: Wrench, energy_j: f64) {
        (self.by_models, self.unfelt_torque_nm) = if self.at_hand.contains(Demand::TORQUE) {
            (wrench, DVec3::ZERO)
        } else {
            (Wrench::from_force(wrench.force()), wrench.torque())
        };
        (self.requested, self.energy_j, self.computed) = (self.by_models, energy_j, demand.computed());
    }

    /// Adds the contribution of a shared model to the request, before those of the couplings. Real-time: bounded, no allocation.
    pub(crate) fn add_model(&mut self, wrench: Wrench, energy_j: f64, effort: f64) {
        if self.at_hand.contains(Demand::TORQUE) {
            self.by_models = self.by_models + wrench;
        } else {
            self.by_models = self.by_models + Wrench::from_force(wrench.force());
            self.unfelt_torque_nm += wrench.torque();
        }
        (self.requested, self.energy_j) = (self.by_models, self.energy_j + energy_j);
        self.grip.iter_mut().for_each(|grip| grip.model += effort);
    }

    /// Adds the pull of a coupling to the request.
    #[inline]
    pub(crate) fn add(&mut self, pull: &Pull) {
        self.requested = self.requested + pull.wrench;
        self.energy_j += pull.energy_j;
        if pull.is_damped {
            self.events.insert(Events::PASSIVITY_DAMPED);
        }
    }
}
