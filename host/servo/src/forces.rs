//! Everything that asks for a wrench: the models of each device, and the couplings between devices.
//!
//! The same code runs in the servo and in a replay; that is why a replay can be bit-exact.

use super::Heartbeat;
use super::models::{Layer, LayerReport, ModelHealth, ModelStack, Replacement};
use flotor_core::ModelOutputs;
use flotor_core::demand::TickDemand;
use flotor_core::trace::Events;
use flotor_coupling::{
    Coupling, CouplingDescription, CouplingEnds, Grip, Hearing, Line, Patience, Pull, Reach, RemoteEnd, Tank,
    TankState,
};
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Demand, DeviceState, Tick, Wrench};

/// What passes through the port of one device in a tick, device frame.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Where the handle is, as last known.
    pub state: DeviceState,
    /// The wrench that is held since the last tick.
    pub commanded: Wrench,
    /// Outputs of models that reach the hand here.
    felt: Demand,
    /// Outputs of models that were computed in this tick.
    computed: Demand,
    /// What models and couplings ask for, as far as it reaches the hand.
    pub requested: Wrench,
    /// Of this, what the models alone ask for.
    by_models: Wrench,
    /// Torque of the models that reaches no hand, N·m: for observers, where they asked for it.
    unfelt_torque_nm: DVec3,
    /// Energy stored in models and couplings, J, where it was computed.
    energy_j: f64,
    /// What has happened in this tick.
    pub events: Events,
}

impl Port {
    /// A port at rest of a device where these outputs of models reach the hand ([`flotor_core::demand::felt_within`]).
    #[must_use]
    pub const fn at_rest(felt: Demand) -> Self {
        Self {
            state: DeviceState::HOME,
            commanded: Wrench::ZERO,
            felt,
            computed: felt,
            requested: Wrench::ZERO,
            by_models: Wrench::ZERO,
            unfelt_torque_nm: DVec3::ZERO,
            energy_j: 0.0,
            events: Events::NONE,
        }
    }

    /// Outputs of models and couplings in this tick. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn outputs(&self) -> ModelOutputs {
        let Self { felt, computed, requested, unfelt_torque_nm, energy_j, .. } = self;
        let wrench = if felt.contains(Demand::TORQUE) {
            *requested
        } else {
            Wrench::new(requested.force(), requested.torque() + *unfelt_torque_nm)
        };
        ModelOutputs::new(wrench, *energy_j).limited_to(*computed)
    }

    /// Takes what the models ask for: an output that observers alone asked for goes no further than their record.
    #[inline]
    fn take(&mut self, demand: TickDemand, wrench: Wrench, energy_j: f64) {
        (self.by_models, self.unfelt_torque_nm) = if self.felt.contains(Demand::TORQUE) {
            (wrench, DVec3::ZERO)
        } else {
            (Wrench::from_force(wrench.force()), wrench.torque())
        };
        (self.requested, self.energy_j, self.computed) = (self.by_models, energy_j, demand.computed());
    }

    /// What is held for the couplings: all that is not the models'. Exact where a device has no models; where it has,
    /// what the envelope takes away counts as taken from the coupling.
    #[inline]
    fn held_for_couplings(&self) -> Wrench {
        self.commanded - self.by_models
    }

    /// Adds what a coupling asks for.
    #[inline]
    fn add(&mut self, pull: &Pull) {
        self.requested = self.requested + pull.wrench;
        self.energy_j += pull.energy_j;
        if pull.is_damped {
            self.events.insert(Events::PASSIVITY_DAMPED);
        }
    }
}

/// What becomes of a coupling in a run: for reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingOutcome {
    /// The energy tanks of both ends; that of an end on another host as received last.
    pub tanks: [TankState; 2],
    /// How an end on another host was heard.
    pub hearing: Option<Hearing>,
}

/// A coupling and the devices of this run that it holds.
pub enum Coupled {
    /// Both ends are here.
    Here {
        /// Both ends.
        coupling: Box<Coupling>,
        /// Numbers of the devices.
        devices: [usize; 2],
        /// What the ends ask for.
        pulls: [Pull; 2],
    },
    /// The other end is on another host.
    Remote {
        /// The end here.
        end: Box<RemoteEnd>,
        /// Number of its device.
        device: usize,
        /// What it asks for.
        pull: Pull,
    },
}

impl Coupled {
    /// With the line for the peer state, if one end is on another host; `reach` is that of the device here. Not real-time.
    pub fn new(
        description: &CouplingDescription,
        period_s: f64,
        patience: Patience,
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
                let (end, line) = RemoteEnd::new(config, here, period_s, patience, reach);
                let device = usize::from(here.device);
                (Self::Remote { end: Box::new(end), device, pull: Pull::default() }, Some(line))
            }
        }
    }

    /// Asks the coupling. Real-time: bounded, no allocation.
    #[inline]
    fn step(&mut self, tick: &Tick, ports: &[Port]) {
        let grip = |port: &'_ Port| (port.state, port.held_for_couplings());
        match self {
            Self::Here { coupling, devices, pulls } => {
                let [Some(first), Some(second)] = devices.map(|device| ports.get(device).map(grip)) else {
                    return;
                };
                *pulls = coupling.step([&first, &second].map(|(state, held)| Grip { state, held: *held }));
            }
            Self::Remote { end, device, pull } => {
                let Some((state, held)) = ports.get(*device).map(grip) else { return };
                *pull = end.step(tick, Grip { state: &state, held });
            }
        }
    }

    /// Adds what it asked for. Real-time: bounded, no allocation.
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
                if end.is_alone() {
                    port.events.insert(Events::PARTNER_SILENT);
                }
                if end.is_implausible() {
                    port.events.insert(Events::IMPLAUSIBLE_SAMPLE);
                }
                if end.is_cut() {
                    port.events.insert(Events::PARTNER_LIMITED);
                }
            }
        }
    }

    /// Not real-time.
    fn outcome(&self) -> CouplingOutcome {
        match self {
            Self::Here { coupling, .. } => {
                CouplingOutcome { tanks: coupling.tanks().map(Tank::state), hearing: None }
            }
            Self::Remote { end, .. } => {
                let hearing = end.hearing();
                CouplingOutcome { tanks: [end.tank(), hearing.partner], hearing: Some(hearing) }
            }
        }
    }
}

/// Which device a model is on, and which of the models there it is.
#[derive(Clone, Copy, Debug)]
struct Whereabouts {
    device: usize,
    place: usize,
}

/// All models and couplings of a run.
pub struct Forces {
    /// The models of each device.
    stacks: Box<[ModelStack]>,
    /// By number of the model in the scene.
    models: Box<[Whereabouts]>,
    couplings: Box<[Coupled]>,
}

impl Forces {
    /// `layers` are the scene's models, each with the device it is on. Not real-time.
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

    /// Asks all of them at the states of the ports, one for each device; observers ask for the outputs `observed`. Real-time:
    /// bounded by the models that are near, no allocation.
    pub fn step(&mut self, tick: &Tick, ports: &mut [Port], observed: Demand, heart: &Heartbeat) {
        // The couplings first: what is held now is what they and the models asked for last.
        self.couplings.iter_mut().for_each(|coupled| coupled.step(tick, ports));
        for (stack, port) in self.stacks.iter_mut().zip(&mut *ports) {
            let demand = TickDemand::new(port.felt, observed.limited_to(stack.observable()));
            let (wrench, energy_j) = stack.step(tick, &port.state, demand, heart, &mut port.events);
            port.take(demand, wrench, energy_j);
        }
        self.couplings.iter().for_each(|coupled| coupled.add_to(ports));
    }

    /// The models a model's number stands for, and its place among them.
    #[inline]
    fn stack_of(&mut self, model: usize) -> Option<(&mut ModelStack, usize)> {
        let Whereabouts { device, place } = *self.models.get(model)?;
        Some((self.stacks.get_mut(device)?, place))
    }

    /// Changes a live parameter of the model numbered `model`. Real-time: bounded by its objects, no allocation.
    pub fn set_parameter(&mut self, model: usize, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        match self.stack_of(model) {
            Some((stack, place)) => stack.set_parameter(place, tick, parameter, value),
            None => CallStatus::Unsupported,
        }
    }

    /// Moves the weight of the model numbered `model` to a new value, at its rate. Real-time: bounded, no allocation.
    pub fn set_weight(&mut self, model: usize, tick: &Tick, weight: f64) -> CallStatus {
        match self.stack_of(model) {
            Some((stack, place)) => stack.set_weight(place, tick, weight),
            None => CallStatus::Unsupported,
        }
    }

    /// How often the model numbered `model` was replaced. Real-time: bounded, no allocation.
    #[inline]
    pub fn generation(&mut self, model: usize) -> Option<u16> {
        self.stack_of(model).and_then(|(stack, place)| stack.generation(place))
    }

    /// Puts another model in place of one, faded in from this tick on. What it pushes out, because it was still
    /// fading, is returned: dropping it is not for the loop.
    ///
    /// Real-time: bounded by the objects of the model, no allocation.
    pub fn replace(&mut self, replacement: Replacement, tick: &Tick) -> Option<Box<Layer>> {
        let Replacement { model, generation, layer } = replacement;
        match self.stack_of(model as usize) {
            Some((stack, place)) => stack.replace(place, layer, generation, tick),
            None => Some(layer),
        }
    }

    /// A layer that has faded out, and the number of its model. Real-time: bounded by the models, no allocation.
    #[inline]
    pub fn take_faded(&mut self, tick: &Tick) -> Option<(u32, Box<Layer>)> {
        self.stacks.iter_mut().find_map(|stack| stack.take_faded(tick))
    }

    /// Whether a layer is fading out. Real-time: bounded by the models, no allocation.
    pub(crate) fn is_fading(&self) -> bool {
        self.stacks.iter().any(ModelStack::is_fading)
    }

    /// What is known of every layer that is in place or fading out; `asks` hears of the model that is asked next what it
    /// said last. Not real-time.
    pub fn reports(&mut self, asks: impl Fn(usize)) -> Vec<LayerReport> {
        self.stacks.iter_mut().flat_map(|stack| stack.reports(&asks)).collect()
    }

    /// All layers, each with the number of its model. Not real-time.
    pub fn into_layers(self) -> impl Iterator<Item = (usize, Box<Layer>)> {
        self.stacks.into_iter().flat_map(ModelStack::into_layers)
    }

    /// Of every model, health and last words of the layer in place, in the scene's order. Not real-time.
    pub fn health(&mut self) -> Vec<(ModelHealth, String)> {
        let mut stacks: Vec<_> = self.stacks.iter_mut().map(|stack| stack.health().into_iter()).collect();
        let next = |at: &Whereabouts| stacks.get_mut(at.device).and_then(Iterator::next);
        self.models.iter().filter_map(next).collect()
    }

    /// What has become of each coupling. Not real-time.
    pub fn coupling_outcomes(&self) -> Vec<CouplingOutcome> {
        self.couplings.iter().map(Coupled::outcome).collect()
    }
}
