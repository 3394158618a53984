//! Force sources: the models of each device, and the couplings between devices.
//!
//! Servo and replay run the same code, so that a replay can be bit-exact.

use super::Heartbeat;
use super::models::{Contribution, Layer, LayerReport, ModelStack, Replacement, Slot, StepContext};
use flotor_core::ModelOutputs;
use flotor_core::demand::TickDemand;
use flotor_core::grip::GripRecord;
use flotor_core::health::ModelHealth;
use flotor_core::trace::Events;
use flotor_coupling::{
    Coupling, CouplingDescription, CouplingEnds, Line, LinkStatistics, LinkTimeouts, PortSample, Pull, Reach,
    RemoteEnd, Tank, TankState,
};
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Demand, DeviceState, Tick, Wrench};
use flotor_loader::InstanceState;

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
    at_hand: Demand,
    /// Model outputs computed in this tick.
    computed: Demand,
    /// Wrench requested by models and couplings, without the models' torque if the device exerts none.
    pub requested: Wrench,
    /// Part of `requested` from the models.
    by_models: Wrench,
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
    fn take(&mut self, demand: TickDemand, wrench: Wrench, energy_j: f64) {
        (self.by_models, self.unfelt_torque_nm) = if self.at_hand.contains(Demand::TORQUE) {
            (wrench, DVec3::ZERO)
        } else {
            (Wrench::from_force(wrench.force()), wrench.torque())
        };
        (self.requested, self.energy_j, self.computed) = (self.by_models, energy_j, demand.computed());
    }

    /// Adds the pull of a coupling to the request.
    #[inline]
    fn add(&mut self, pull: &Pull) {
        self.requested = self.requested + pull.wrench;
        self.energy_j += pull.energy_j;
        if pull.is_damped {
            self.events.insert(Events::PASSIVITY_DAMPED);
        }
    }
}

/// Statistics of a coupling after a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingOutcome {
    /// Energy tanks of both ends; the tank of a remote end as last received.
    pub tanks: [TankState; 2],
    /// Link statistics of a remote end; `None` if both ends are on this host.
    pub link: Option<LinkStatistics>,
}

/// Coupling with its devices in this run.
pub enum Coupled {
    /// Coupling with both ends on this host.
    Here {
        /// State of the coupling.
        coupling: Box<Coupling>,
        /// Device numbers of the ends.
        devices: [usize; 2],
        /// Pulls of the ends in the last step.
        pulls: [Pull; 2],
    },
    /// Coupling with a remote end.
    Remote {
        /// State of the end on this host.
        end: Box<RemoteEnd>,
        /// Device number of the end.
        device: usize,
        /// Pull of the end in the last step.
        pull: Pull,
    },
}

impl Coupled {
    /// Creates a coupling; if one end is remote, returns the line of the peer link as well. `reach` is the range of the local
    /// device. Not real-time.
    pub fn new(
        description: &CouplingDescription,
        period_s: f64,
        timeouts: LinkTimeouts,
        reach: Reach,
    ) -> (Self, Option<Line>) {
        let CouplingDescription { config, ends, .. } = description;
        match ends {
            CouplingEnds::Here(ends) => {
                let devices = ends.map(|end| usize::from(end.device));
                let coupling = Box::new(Coupling::new(config, ends, period_s));
                (Self::Here { coupling, devices, pulls: [Pull::default(); 2] }, None)
            }
            CouplingEnds::Remote(here) => {
                let (end, line) = RemoteEnd::new(config, here, period_s, timeouts, reach);
                let device = usize::from(here.device);
                (Self::Remote { end: Box::new(end), device, pull: Pull::default() }, Some(line))
            }
        }
    }

    /// Computes the pulls of the coupling. Real-time: bounded, no allocation.
    #[inline]
    fn step(&mut self, tick: &Tick, ports: &[Port]) {
        // Held wrench of the couplings: the command less the models' request. Exact for a device without models; with models, a
        // reduction by the envelope is attributed to the coupling.
        let grip = |port: &'_ Port| (port.state, port.commanded - port.by_models);
        match self {
            Self::Here { coupling, devices, pulls } => {
                let [Some(first), Some(second)] = devices.map(|device| ports.get(device).map(grip)) else {
                    return;
                };
                *pulls =
                    coupling.step([&first, &second].map(|(state, held)| PortSample { state, held: *held }));
            }
            Self::Remote { end, device, pull } => {
                let Some((state, held)) = ports.get(*device).map(grip) else { return };
                *pull = end.step(tick, PortSample { state: &state, held });
            }
        }
    }

    /// Adds the pulls of the coupling to the ports. Real-time: bounded, no allocation.
    #[inline]
    fn add_to(&self, ports: &mut [Port]) {
        match self {
            Self::Here { devices, pulls, .. } => {
                for (device, pull) in devices.iter().zip(pulls) {
                    let Some(port) = ports.get_mut(*device) else { continue };
                    port.add(pull);
                }
            }
            Self::Remote { end, device, pull } => {
                let Some(port) = ports.get_mut(*device) else { return };
                port.add(pull);
                port.events.insert(end.events());
            }
        }
    }

    /// Returns the statistics of the coupling. Not real-time.
    fn outcome(&self) -> CouplingOutcome {
        match self {
            Self::Here { coupling, .. } => {
                CouplingOutcome { tanks: coupling.tanks().map(Tank::state), link: None }
            }
            Self::Remote { end, .. } => {
                let link = end.link();
                CouplingOutcome { tanks: [end.tank(), link.partner], link: Some(link) }
            }
        }
    }
}

/// Position of a model: its device, and its index in the device's stack.
#[derive(Clone, Copy, Debug)]
struct Whereabouts {
    device: usize,
    place: usize,
}

/// Models and couplings of a run.
pub struct Forces {
    /// The models of each device.
    stacks: Box<[ModelStack]>,
    /// Positions of the models, by their number in the scene.
    models: Box<[Whereabouts]>,
    couplings: Box<[Coupled]>,
}

impl Forces {
    /// Creates the force sources of `devices` devices; `layers` are the models in the scene's order, each with the number of its
    /// device. Not real-time.
    pub fn new(devices: usize, layers: Vec<(usize, Layer)>, couplings: Vec<Coupled>) -> Self {
        let mut on_device: Vec<Vec<(usize, Layer)>> =
            std::iter::repeat_with(Vec::new).take(devices).collect();
        let mut models = Vec::with_capacity(layers.len());
        for (number, (device, layer)) in layers.into_iter().enumerate() {
            let Some(stack) = on_device.get_mut(device) else { continue };
            models.push(Whereabouts { device, place: stack.len() });
            stack.push((number, layer));
        }
        Self {
            stacks: on_device.into_iter().map(ModelStack::new).collect(),
            models: models.into(),
            couplings: couplings.into(),
        }
    }

    /// Steps all couplings and models at the states of the ports, and stores the requested wrenches, energies and events in the
    /// ports; one port per device. `observed`: outputs that observers demand. Real-time: bounded by the models that are near, no
    /// allocation.
    pub fn step(&mut self, tick: &Tick, ports: &mut [Port], observed: Demand, heartbeat: &Heartbeat) {
        // Couplings first: the held wrench is still the last request of couplings and models.
        self.couplings.iter_mut().for_each(|coupled| coupled.step(tick, ports));
        for (stack, port) in self.stacks.iter_mut().zip(&mut *ports) {
            let demand = TickDemand::new(port.at_hand, observed.limited_to(stack.observable()));
            let sampled = port.grip.map(|grip| grip.state);
            let context = StepContext { tick, state: &port.state, grip: sampled.as_ref(), demand };
            let Contribution { wrench, energy_j, effort } = stack.step(&context, heartbeat, &mut port.events);
            port.take(demand, wrench, energy_j);
            port.grip.iter_mut().for_each(|grip| grip.model = effort);
        }
        self.couplings.iter().for_each(|coupled| coupled.add_to(ports));
    }

    /// Returns the stack of a model and the model's index in that stack.
    #[inline]
    fn stack_of(&mut self, model: usize) -> Option<(&mut ModelStack, usize)> {
        let Whereabouts { device, place } = *self.models.get(model)?;
        Some((self.stacks.get_mut(device)?, place))
    }

    /// Returns the slot of a model.
    #[inline]
    fn slot_of(&mut self, model: usize) -> Option<&mut Slot> {
        let (stack, place) = self.stack_of(model)?;
        stack.slots.get_mut(place)
    }

    /// Iterates over the slots of all models, by device.
    #[inline]
    fn slots(&mut self) -> impl Iterator<Item = &mut Slot> {
        self.stacks.iter_mut().flat_map(|stack| &mut stack.slots)
    }

    /// Changes a live parameter of the current layer of the model numbered `model`; unsupported if there is no such model.
    /// Real-time: bounded by the model's objects, no allocation.
    pub fn set_parameter(&mut self, model: usize, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        match self.stack_of(model) {
            Some((stack, place)) => stack.set_parameter(place, tick, parameter, value),
            None => CallStatus::Unsupported,
        }
    }

    /// Sets the target weight of the model numbered `model`, 0 to 1, to which the weight moves at the model's fade rate;
    /// unsupported if there is no such model. Real-time: bounded, no allocation.
    pub fn set_weight(&mut self, model: usize, tick: &Tick, weight: f64) -> CallStatus {
        let Some(slot) = self.slot_of(model) else { return CallStatus::Unsupported };
        slot.set_weight(tick, weight);
        CallStatus::Ok
    }

    /// Returns the generation of the model numbered `model`, the number of its replacements; `None` if there is no such model.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn generation(&mut self, model: usize) -> Option<u16> {
        self.slot_of(model).map(|slot| slot.generation())
    }

    /// Replaces a model; the new layer fades in from this tick on. Returns an older layer that was still fading out (or the new
    /// layer if there is no such model), to be dropped outside the loop.
    ///
    /// Real-time: bounded by the objects of the model, no allocation.
    pub fn replace(&mut self, replacement: Replacement, tick: &Tick) -> Option<Box<Layer>> {
        let Replacement { model, generation, layer } = replacement;
        match self.stack_of(model) {
            Some((stack, place)) => stack.replace(place, layer, generation, tick),
            None => Some(layer),
        }
    }

    /// Removes a layer that has faded out; returns the layer with its model number, or `None` if no layer has. Real-time: bounded
    /// by the models, no allocation.
    #[inline]
    pub fn take_faded(&mut self, tick: &Tick) -> Option<(usize, Box<Layer>)> {
        let take = |slot: &mut Slot| Some((slot.number, slot.take_faded(tick)?));
        self.slots().find_map(take)
    }

    /// Iterates over the states of all instances before a tick, each with its model number; `None` for one whose state cannot be
    /// saved. Not part of them: couplings, blends of models, and a layer that is fading out.
    pub fn states(&mut self, tick: u64) -> impl Iterator<Item = (usize, Option<InstanceState<'_>>)> {
        self.slots().flat_map(move |slot| {
            let number = slot.number;
            slot.states(tick).map(move |state| (number, state))
        })
    }

    /// Returns true while a layer is fading out. Real-time: bounded by the models, no allocation.
    pub fn is_fading(&self) -> bool {
        self.stacks.iter().any(|stack| stack.slots.iter().any(Slot::is_fading))
    }

    /// Returns a report on every current layer and every layer that is fading out; calls `on_query` with the model number before
    /// each query of a model's last message. Not real-time.
    pub fn reports(&mut self, on_query: impl Fn(usize)) -> Vec<LayerReport> {
        self.slots().flat_map(|slot| slot.reports(&on_query)).collect()
    }

    /// Returns all current layers and layers that are fading out, each with its model number. Not real-time.
    pub fn into_layers(self) -> impl Iterator<Item = (usize, Box<Layer>)> {
        self.stacks.into_iter().flat_map(|stack| stack.slots).flat_map(Slot::into_layers)
    }

    /// Returns health and last message of the current layer of each model, in the scene's order. Not real-time.
    pub fn health(&mut self) -> Vec<(ModelHealth, String)> {
        (0..self.models.len()).filter_map(|model| Some(self.slot_of(model)?.health())).collect()
    }

    /// Returns the statistics of each coupling. Not real-time.
    pub fn coupling_outcomes(&self) -> Vec<CouplingOutcome> {
        self.couplings.iter().map(Coupled::outcome).collect()
    }
}
