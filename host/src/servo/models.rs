//! The force models of a loop: each in its own frame, their wrenches added up in the device's.
//!
//! The same code runs in the servo and in a replay; that is why a replay can be bit-exact.

use super::watchdog::{Heartbeat, Place};
use crate::mapping::Mapping;
use crate::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::Model;
use flotor_hal::{Demand, DeviceState, Input, Output, StepStatus, Tick, Wrench};

/// A model in the loop.
pub(crate) struct ModelSlot {
    pub(crate) model: Model,
    pub(crate) mapping: Mapping,
    pub(crate) demand: Demand,
    pub(crate) health: ModelHealth,
}

/// How a model has behaved so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ModelHealth {
    /// The tick at which it panicked; from then on it is out.
    pub panicked_at: Option<u64>,
    /// Ticks whose answer was not finite or outside the contract; each counted as no force.
    pub rejected_ticks: u64,
    /// The first of them.
    pub first_rejected: Option<u64>,
}

impl ModelHealth {
    fn reject(&mut self, tick: u64) {
        self.rejected_ticks += 1;
        self.first_rejected.get_or_insert(tick);
    }
}

/// All models of a loop.
pub(crate) struct ModelStack {
    slots: Box<[ModelSlot]>,
}

impl ModelStack {
    /// Not real-time.
    pub(crate) fn new(slots: Vec<ModelSlot>) -> Self {
        Self { slots: slots.into_boxed_slice() }
    }

    /// Sum of what the models ask for at a state of the device, in the device frame, and of the energy they store,
    /// J. Real-time: bounded by the models, no allocation.
    #[inline]
    pub(crate) fn step(
        &mut self,
        tick: &Tick,
        state: &DeviceState,
        heart: &Heartbeat,
        events: &mut Events,
    ) -> (Wrench, f64) {
        let mut sum = Wrench::ZERO;
        let mut energy_j = 0.0;
        for (index, slot) in self.slots.iter_mut().enumerate() {
            heart.enter(tick.index, Place::Model(index));
            if slot.health.panicked_at.is_some() {
                events.insert(Events::MODEL_FAULT);
                continue;
            }
            let Some(output) = slot.step(tick, state) else {
                events.insert(Events::MODEL_FAULT);
                continue;
            };
            sum = sum + slot.mapping.wrench_to_device(&output.wrench);
            if output.energy_j.is_finite() {
                energy_j += output.energy_j * slot.mapping.energy_scale();
            }
            if output.status() != Some(StepStatus::Ok) {
                events.insert(Events::MODEL_DEGRADED);
            }
        }
        heart.enter(tick.index, Place::Host);
        (sum, energy_j)
    }

    /// Changes a live parameter of the model numbered `model`. Real-time: bounded by the model, no allocation.
    pub(crate) fn set_parameter(
        &mut self,
        model: usize,
        tick: &Tick,
        parameter: usize,
        value: f64,
    ) -> CallStatus {
        let Some(slot) = self.slots.get_mut(model) else { return CallStatus::Unsupported };
        let status = slot.model.set_parameter(parameter, value);
        if status == CallStatus::Panicked {
            slot.health.panicked_at.get_or_insert(tick.index);
        }
        status
    }

    /// Every model with its health and what it said last. Not real-time.
    pub(crate) fn health(&mut self) -> Vec<(ModelHealth, String)> {
        self.slots.iter_mut().map(|slot| (slot.health, slot.model.last_message())).collect()
    }
}

impl ModelSlot {
    /// The model's answer, in its own frame; `None`, booked in its health, if it has none that can be used.
    #[inline]
    fn step(&mut self, tick: &Tick, state: &DeviceState) -> Option<Output> {
        let input = Input {
            pose: self.mapping.pose_to_model(&state.pose),
            twist: self.mapping.twist_to_model(&state.twist),
            time_ns: tick.time_ns,
            dt_ns: tick.dt_ns,
            tick: tick.index,
            buttons: state.buttons,
            demand: self.demand,
        };
        let mut output = Output::default();
        match self.model.step(&input, &mut output) {
            CallStatus::Ok if output.wrench.is_finite() && output.status().is_some() => Some(output),
            CallStatus::Ok => {
                self.health.reject(tick.index);
                None
            }
            _ => {
                self.health.panicked_at = Some(tick.index);
                None
            }
        }
    }
}
