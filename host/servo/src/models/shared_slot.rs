//! Slot of a model that several devices share.

use super::contribution::{Contribution, Sample, Share};
use super::model_layer::ModelLayer;
use super::shared_object::SharedObject;
use super::slot::Slot;
use super::stack::ModelStack;
use crate::port::Port;
use crate::{Heartbeat, Place};
use flotor_core::demand::TickDemand;
use flotor_core::trace::Events;
use flotor_hal::{Demand, MAX_PORTS, Tick};

/// Slot of a shared model, with the devices of its ports.
pub(crate) struct SharedSlot {
    pub(crate) slot: Slot<SharedObject>,
    devices: Box<[usize]>,
}

impl SharedSlot {
    /// Creates the slot of the model numbered `number`, on the devices of its ports. Not real-time.
    pub(crate) fn new(number: usize, layer: Box<ModelLayer<SharedObject>>, devices: Vec<usize>) -> Self {
        Self { slot: Slot::new(number, layer), devices: devices.into() }
    }

    /// Returns the priority of the model if it is on a device.
    pub(crate) fn priority_on(&self, device: usize) -> Option<u8> {
        self.devices.contains(&device).then_some(self.slot.priority)
    }

    /// Steps the model once for all its ports, and adds the contribution of each port, times its weight there, to the requests of the
    /// devices. Handles far away do not stop the object; a weight of 0 does. `observed`: outputs that observers demand.
    ///
    /// Real-time: bounded by the model, no allocation.
    pub(crate) fn step(
        &mut self,
        tick: &Tick,
        stacks: &mut [ModelStack],
        ports: &mut [Port],
        observed: Demand,
        heartbeat: &Heartbeat,
    ) {
        let Self { slot, devices } = self;
        if slot.weight.is_silent(tick.time_ns) {
            return;
        }
        heartbeat.enter(tick.index, Place::Model(slot.number));
        let mut events = [Events::NONE; MAX_PORTS];
        let samples: [Option<Sample<'_>>; MAX_PORTS] = std::array::from_fn(|port| {
            let device = *devices.get(port)?;
            let (stack, port) = (stacks.get(device)?, ports.get(device)?);
            let demand = TickDemand::new(port.at_hand, observed.limited_to(stack.observable()));
            Some(Sample { state: &port.state, grip: port.grip.as_ref().map(|grip| &grip.state), demand })
        });
        let shares = slot.step(tick, &samples, &mut events);
        let weight = slot.weight.at(tick.time_ns);
        for ((share, events), device) in shares.iter().zip(events).zip(&**devices) {
            let (Some(stack), Some(port)) = (stacks.get_mut(*device), ports.get_mut(*device)) else {
                continue;
            };
            port.events.insert(events);
            let weight = stack.weigh(slot.priority, weight, share, port.at_hand, tick);
            let Contribution { wrench, energy_j, effort } = share.times(weight);
            port.add_model(wrench, energy_j, effort);
        }
    }
}

/// Limits the observable outputs of each device to those of its shared models: energy only if each of them computes its energy.
/// Real-time: bounded by devices and models, no allocation.
pub(crate) fn limit_observable(shared: &[SharedSlot], stacks: &mut [ModelStack]) {
    for (device, stack) in stacks.iter_mut().enumerate() {
        let mut here = shared.iter().filter(|shared| shared.devices.contains(&device));
        let all_give = here.all(|shared| shared.slot.gives_energy());
        stack.shared_observable = if all_give { Demand::ALL } else { Demand::WRENCH };
    }
}
