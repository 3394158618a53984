//! Force sources: the models of each device, and the couplings between devices.
//!
//! Servo and replay run the same code, so that a replay can be bit-exact.

use super::models::{
    Body, Contribution, Kind, Layer, LayerReport, ModelStack, Objects, Replacement, Sample, SavedSlot,
    SharedObject, SharedSlot, Slot, limit_observable,
};
use super::port::Port;
use super::{Heartbeat, Place, Unsaved};
use flotor_core::PluginIndex;
use flotor_core::demand::TickDemand;
use flotor_core::health::ModelHealth;
use flotor_core::weight::Fade;
use flotor_coupling::{
    Coupling, CouplingDescription, CouplingEnds, Line, LinkStatistics, LinkTimeouts, PortSample, Pull, Reach,
    RemoteEnd, Tank, TankState,
};
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Tick};
use flotor_loader::InstanceState;

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

/// Position of a model.
#[derive(Clone, Copy, Debug)]
enum Whereabouts {
    /// In the stack of a device.
    OnDevice {
        /// Number of the device.
        device: usize,
        /// Index in its stack.
        place: usize,
    },
    /// Among the shared models, at this index.
    Shared(usize),
}

/// Saved state of all models and couplings.
pub(crate) struct SavedForces {
    /// States of all instances, in the order of [`Forces::states`].
    instances: Vec<Vec<u8>>,
    slots: Vec<SavedSlot<Objects>>,
    shared: Vec<SavedSlot<SharedObject>>,
    gains: Vec<Fade>,
    couplings: Vec<(Box<Coupling>, [Pull; 2])>,
}

/// Models and couplings of a run.
pub struct Forces {
    /// The models of each device.
    stacks: Box<[ModelStack]>,
    /// The models that several devices share.
    shared: Box<[SharedSlot]>,
    /// Positions of the models, by their number in the scene.
    models: Box<[Whereabouts]>,
    couplings: Box<[Coupled]>,
}

/// Calls the same function on the slot of a model, on a device or shared; returns `none` if there is no such model.
macro_rules! with_slot {
    ($forces:expr, $model:expr, $slot:ident => $call:expr, $none:expr) => {
        match $forces.models.get($model).copied() {
            Some(Whereabouts::OnDevice { device, place }) => {
                match $forces.stacks.get_mut(device).and_then(|stack| stack.slots.get_mut(place)) {
                    Some($slot) => $call,
                    None => $none,
                }
            }
            Some(Whereabouts::Shared(index)) => {
                match $forces.shared.get_mut(index).map(|shared| &mut shared.slot) {
                    Some($slot) => $call,
                    None => $none,
                }
            }
            None => $none,
        }
    };
}

impl Forces {
    /// Creates the force sources of `devices` devices; `layers` are the models in the scene's order, each with the numbers of its
    /// devices: one, or those of the ports of a shared model. Not real-time.
    pub fn new(devices: usize, layers: Vec<(Vec<usize>, Layer)>, couplings: Vec<Coupled>) -> Self {
        let mut on_device: Vec<Vec<_>> = std::iter::repeat_with(Vec::new).take(devices).collect();
        let (mut models, mut shared) = (Vec::with_capacity(layers.len()), Vec::new());
        for (number, (ports, Layer(layer))) in layers.into_iter().enumerate() {
            match layer {
                Kind::OnDevice(layer) => {
                    let device = ports.first().copied().unwrap_or(devices);
                    let Some(stack) = on_device.get_mut(device) else { continue };
                    models.push(Whereabouts::OnDevice { device, place: stack.len() });
                    stack.push((number, layer));
                }
                Kind::Shared(layer) => {
                    models.push(Whereabouts::Shared(shared.len()));
                    shared.push(SharedSlot::new(number, layer, ports));
                }
            }
        }
        let stack = |(device, layers)| {
            let priorities: Vec<u8> = shared.iter().filter_map(|shared| shared.priority_on(device)).collect();
            ModelStack::new(layers, &priorities)
        };
        let mut stacks: Box<[ModelStack]> = on_device.into_iter().enumerate().map(stack).collect();
        limit_observable(&shared, &mut stacks);
        Self { stacks, shared: shared.into(), models: models.into(), couplings: couplings.into() }
    }

    /// Steps all couplings and models at the states of the ports, and stores the requested wrenches, energies and events in the
    /// ports; one port per device. `observed`: outputs that observers demand. Real-time: bounded by the models that are near, no
    /// allocation.
    #[inline(always)] // in the middle of a tick
    pub fn step(&mut self, tick: &Tick, ports: &mut [Port], observed: Demand, heartbeat: &Heartbeat) {
        // Couplings first: the held wrench is still the last request of couplings and models.
        self.couplings.iter_mut().for_each(|coupled| coupled.step(tick, ports));
        for (stack, port) in self.stacks.iter_mut().zip(&mut *ports) {
            let demand = TickDemand::new(port.at_hand, observed.limited_to(stack.observable()));
            let grip = port.grip.as_ref().map(|grip| &grip.state);
            let sample = Sample { state: &port.state, grip, demand };
            let Contribution { wrench, energy_j, effort } =
                stack.step(tick, &sample, heartbeat, &mut port.events);
            port.take(demand, wrench, energy_j);
            port.grip.iter_mut().for_each(|grip| grip.model = effort);
        }
        if !self.shared.is_empty() {
            let Self { shared, stacks, .. } = self;
            shared.iter_mut().for_each(|shared| shared.step(tick, stacks, ports, observed, heartbeat));
            heartbeat.enter(tick.index, Place::Host);
        }
        self.stacks.iter_mut().for_each(|stack| stack.settle(tick));
        self.couplings.iter().for_each(|coupled| coupled.add_to(ports));
    }

    /// Changes a live parameter of the current layer of the model numbered `model`; unsupported if there is no such model.
    /// Real-time: bounded by the model's objects, no allocation.
    pub fn set_parameter(&mut self, model: usize, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        match self.models.get(model).copied() {
            Some(Whereabouts::OnDevice { device, place }) => match self.stacks.get_mut(device) {
                Some(stack) => stack.set_parameter(place, tick, parameter, value),
                None => CallStatus::Unsupported,
            },
            _ => {
                with_slot!(self, model, slot => slot.set_parameter(tick, parameter, value), CallStatus::Unsupported)
            }
        }
    }

    /// Sets the target weight of the model numbered `model`, 0 to 1, to which the weight moves at the model's fade rate;
    /// unsupported if there is no such model. Real-time: bounded, no allocation.
    pub fn set_weight(&mut self, model: usize, tick: &Tick, weight: f64) -> CallStatus {
        with_slot!(self, model, slot => slot.set_weight(tick, weight), return CallStatus::Unsupported);
        CallStatus::Ok
    }

    /// Returns the generation of the model numbered `model`, the number of its replacements; `None` if there is no such model.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn generation(&mut self, model: usize) -> Option<u16> {
        with_slot!(self, model, slot => Some(slot.generation()), None)
    }

    /// Replaces a model, a shared one at all its ports; the new layer fades in from this tick on. Returns an older layer that was
    /// still fading out (or the new layer if there is no such model of its kind), to be dropped outside the loop.
    ///
    /// Real-time: bounded by the objects of the model, no allocation.
    pub fn replace(&mut self, replacement: Replacement, tick: &Tick) -> Option<Layer> {
        let Replacement { model, generation, layer: Layer(layer) } = replacement;
        let Self { stacks, shared, models, .. } = self;
        match (models.get(model).copied(), layer) {
            (Some(Whereabouts::OnDevice { device, place }), Kind::OnDevice(layer)) => {
                match stacks.get_mut(device) {
                    Some(stack) => stack.replace(place, layer, generation, tick).map(Layer::from),
                    None => Some(layer.into()),
                }
            }
            (Some(Whereabouts::Shared(index)), Kind::Shared(layer)) => {
                let Some(slot) = shared.get_mut(index).map(|shared| &mut shared.slot) else {
                    return Some(layer.into());
                };
                let pushed_out = slot.put(layer, generation, tick);
                limit_observable(shared, stacks);
                pushed_out.map(Layer::from)
            }
            (_, layer) => Some(Layer(layer)),
        }
    }

    /// Removes a layer that has faded out; returns the layer with its model number, or `None` if no layer has. Real-time: bounded
    /// by the models, no allocation.
    #[inline]
    pub fn take_faded(&mut self, tick: &Tick) -> Option<(usize, Layer)> {
        let mut on_devices = self.stacks.iter_mut().flat_map(|stack| &mut stack.slots);
        let mut shared = self.shared.iter_mut().map(|shared| &mut shared.slot);
        on_devices
            .find_map(|slot| Some((slot.number, slot.take_faded(tick)?.into())))
            .or_else(|| shared.find_map(|slot| Some((slot.number, slot.take_faded(tick)?.into()))))
    }

    /// Iterates over the states of all instances before a tick, each with its model number; `None` for one whose state cannot be
    /// saved. Not part of them: couplings, blends of models, and a layer that is fading out.
    pub fn states(&mut self, tick: u64) -> impl Iterator<Item = (usize, Option<InstanceState<'_>>)> {
        let on_devices = self.stacks.iter_mut().flat_map(|stack| &mut stack.slots);
        let shared = self.shared.iter_mut().map(|shared| &mut shared.slot);
        let on_devices = on_devices.flat_map(move |slot| numbered_states(slot, tick));
        on_devices.chain(shared.flat_map(move |slot| numbered_states(slot, tick)))
    }

    /// Saves the state of all models and couplings before a tick; the run has `devices` devices. Not real-time.
    pub(crate) fn save(&mut self, devices: usize, tick: u64) -> Result<SavedForces, Unsaved> {
        let plugin = |model| PluginIndex::of_model(devices, model);
        let instance = |(model, state): (usize, Option<InstanceState<'_>>)| {
            state.and_then(|mut state| state.to_bytes()).ok_or(Unsaved::Plugin(plugin(model)))
        };
        let instances = self.states(tick).map(instance).collect::<Result<_, _>>()?;
        let coupling = |coupled: &Coupled| match coupled {
            Coupled::Here { coupling, pulls, .. } => Ok((coupling.clone(), *pulls)),
            Coupled::Remote { .. } => Err(Unsaved::Remote),
        };
        let Self { stacks, shared, couplings, .. } = self;
        let slots = stacks.iter_mut().flat_map(|stack| &mut stack.slots);
        Ok(SavedForces {
            instances,
            slots: slots.map(|slot| slot.save(plugin(slot.number))).collect::<Result<_, _>>()?,
            shared: (shared.iter_mut().map(|shared| shared.slot.save(plugin(shared.slot.number))))
                .collect::<Result<_, _>>()?,
            gains: stacks.iter_mut().flat_map(ModelStack::gains).map(|gain| *gain).collect(),
            couplings: couplings.iter().map(coupling).collect::<Result<_, _>>()?,
        })
    }

    /// Restores the state of all models and couplings before a tick. Not real-time.
    pub(crate) fn restore(&mut self, saved: &SavedForces, devices: usize, tick: u64) -> Result<(), Unsaved> {
        let plugin = |model| PluginIndex::of_model(devices, model);
        let Self { stacks, shared, couplings, .. } = self;
        for (slot, saved) in stacks.iter_mut().flat_map(|stack| &mut stack.slots).zip(&saved.slots) {
            slot.restore(saved, plugin(slot.number))?;
        }
        for (SharedSlot { slot, .. }, saved) in shared.iter_mut().zip(&saved.shared) {
            slot.restore(saved, plugin(slot.number))?;
        }
        stacks
            .iter_mut()
            .flat_map(ModelStack::gains)
            .zip(&saved.gains)
            .for_each(|(gain, saved)| *gain = *saved);
        for (coupled, saved) in couplings.iter_mut().zip(&saved.couplings) {
            let Coupled::Here { coupling, pulls, .. } = coupled else { return Err(Unsaved::Remote) };
            (*coupling, *pulls) = saved.clone();
        }
        // Before the states of the instances, which a parameter may change. A parameter that is not live follows a live one, or cannot
        // have changed.
        let now = Tick { index: tick, time_ns: 0, dt_ns: 0 };
        for (model, parameter, value) in self.changed(saved) {
            let _ = self.set_parameter(model, &now, parameter, value);
        }
        if let Some((model, ..)) = self.changed(saved).first() {
            return Err(Unsaved::Plugin(plugin(*model)));
        }
        let mut instances = saved.instances.iter();
        for (model, state) in self.states(tick) {
            let bytes = instances.next().ok_or(Unsaved::OtherLoop)?;
            let status = state.map(|mut state| state.restore(bytes));
            (status == Some(CallStatus::Ok)).then_some(()).ok_or(Unsaved::Plugin(plugin(model)))?;
        }
        if instances.next().is_some() { Err(Unsaved::OtherLoop) } else { Ok(()) }
    }

    /// Returns the parameters with another value than the saved one: number of the model, index, saved value.
    fn changed(&mut self, saved: &SavedForces) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::new();
        let mut add = |model, changed: Vec<(usize, f64)>| {
            all.extend(changed.into_iter().map(|(parameter, value)| (model, parameter, value)));
        };
        let slots = self.stacks.iter_mut().flat_map(|stack| &mut stack.slots);
        slots.zip(&saved.slots).for_each(|(slot, saved)| add(slot.number, slot.changed(saved)));
        let shared = self.shared.iter_mut().zip(&saved.shared);
        shared.for_each(|(SharedSlot { slot, .. }, saved)| add(slot.number, slot.changed(saved)));
        all
    }

    /// Returns true while a layer is fading out. Real-time: bounded by the models, no allocation.
    pub fn is_fading(&self) -> bool {
        self.stacks.iter().any(|stack| stack.slots.iter().any(Slot::is_fading))
            || self.shared.iter().any(|shared| shared.slot.is_fading())
    }

    /// Returns a report on every current layer and every layer that is fading out; calls `on_query` with the model number before
    /// each query of a model's last message. Not real-time.
    pub fn reports(&mut self, on_query: impl Fn(usize)) -> Vec<LayerReport> {
        let on_devices = self.stacks.iter_mut().flat_map(|stack| &mut stack.slots);
        let shared = self.shared.iter_mut().flat_map(|shared| shared.slot.reports(&on_query));
        on_devices.flat_map(|slot| slot.reports(&on_query)).chain(shared).collect()
    }

    /// Returns all current layers and layers that are fading out, each with its model number. Not real-time.
    pub fn into_layers(self) -> impl Iterator<Item = (usize, Layer)> {
        let on_devices = self.stacks.into_iter().flat_map(|stack| stack.slots).flat_map(Slot::into_layers);
        let shared = self.shared.into_iter().flat_map(|shared| shared.slot.into_layers());
        let shared = shared.map(|(number, layer)| (number, layer.into()));
        on_devices.map(|(number, layer)| (number, layer.into())).chain(shared)
    }

    /// Returns health and last message of the current layer of each model, in the scene's order. Not real-time.
    pub fn health(&mut self) -> Vec<(ModelHealth, String)> {
        let health = |model| with_slot!(self, model, slot => Some(slot.health()), None);
        (0..self.models.len()).filter_map(health).collect()
    }

    /// Returns the statistics of each coupling. Not real-time.
    pub fn coupling_outcomes(&self) -> Vec<CouplingOutcome> {
        self.couplings.iter().map(Coupled::outcome).collect()
    }
}

/// Iterates over the states of a slot's instances before a tick, each with the model number.
fn numbered_states<B: Body>(
    slot: &mut Slot<B>,
    tick: u64,
) -> impl Iterator<Item = (usize, Option<InstanceState<'_>>)> {
    let number = slot.number;
    slot.states(tick).map(move |state| (number, state))
}
