//! One force model with all its instances: the unit that is blended, faded and replaced.

use crate::budget::{Allowed, Answer, TimeBudget};
use crate::engine::{Engine, Stepped};
use flotor_contact::Shortcoming;
use flotor_core::broad_phase::{Bounds, BroadPhase};
use flotor_core::demand::TickDemand;
use flotor_core::end_wall::EndWall;
use flotor_core::grip::GripRecord;
use flotor_core::health::ModelHealth;
use flotor_core::mapping::{Blend, Mapping};
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    DVec3, Demand, DeviceState, GripState, Input, Memory, Output, RegionShape, SampledLoop, StepStatus, Tick,
    Wrench,
};
use flotor_loader::InstanceState;

/// One instance of a model with its mapping.
struct Object {
    model: Engine,
    mapping: Mapping,
    /// Wall at the bounds of the model; `None` for a model without bounds.
    end: Option<EndWall>,
    /// Usable output and effort of the last tick, in the model frame, kept for an engine whose next output may be late.
    last: Option<(Output, f64)>,
    /// Tick of the last step.
    stepped_at: Option<u64>,
    /// Number of calls so far that changed the floating-point environment.
    float_changes: u64,
    /// True after a panic or process exit: the model is not called any more.
    is_disabled: bool,
}

/// Tick, state of the device and of its grip, and demanded outputs of a step.
#[derive(Clone, Copy)]
pub(crate) struct StepContext<'a> {
    pub(crate) tick: &'a Tick,
    pub(crate) state: &'a DeviceState,
    pub(crate) grip: Option<&'a GripState>,
    pub(crate) demand: TickDemand,
}

/// Wrench, energy and effort of one layer, or of all, in a tick. An output that was not computed is NaN.
#[derive(Clone, Copy)]
pub(crate) struct Contribution {
    /// Wrench in the device frame; the torque is NaN if it is not finite and only an observer requests it.
    pub(crate) wrench: Wrench,
    /// Stored energy scaled to the device, J; NaN where it is not finite.
    pub(crate) energy_j: f64,
    /// Effort at the grip scaled to the device, N or N·m; 0 without a grip.
    pub(crate) effort: f64,
}

impl Contribution {
    /// No wrench, no energy and no effort.
    pub(super) const NONE: Contribution = Contribution { wrench: Wrench::ZERO, energy_j: 0.0, effort: 0.0 };

    /// Scales the contribution. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn times(self, part: f64) -> Self {
        Self { wrench: self.wrench * part, energy_j: self.energy_j * part, effort: self.effort * part }
    }

    /// Adds two contributions. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn plus(self, other: Self) -> Self {
        let (wrench, effort) = (self.wrench + other.wrench, self.effort + other.effort);
        Self { wrench, energy_j: self.energy_j + other.energy_j, effort }
    }
}

/// Replaces each output that was not requested, or that is not finite and reaches observers only, with NaN. Returns `None` if an
/// output that reaches the hand is not finite, or the status is unknown. Real-time: bounded, no allocation.
#[inline(always)] // in the middle of a tick
fn usable(demand: TickDemand, mut output: Output) -> Option<Output> {
    output.status()?;
    if demand.at_hand().contains(Demand::TORQUE) {
        if !output.wrench.is_finite() {
            return None;
        }
    } else {
        if !output.wrench.force().is_finite() {
            return None;
        }
        if !(demand.computed().contains(Demand::TORQUE) && output.wrench.torque().is_finite()) {
            output.wrench.torque_nm = [f64::NAN; 3];
        }
    }
    if !(demand.computed().contains(Demand::ENERGY) && output.energy_j.is_finite()) {
        output.energy_j = f64::NAN;
    }
    Some(output)
}

/// Force model with all its instances: the unit of blending and replacement.
pub struct Layer {
    objects: Box<[Object]>,
    broad: BroadPhase,
    /// Outputs that the model can compute.
    pub(super) serves: Demand,
    memory: Memory,
    budget: TimeBudget,
    /// Last contribution, which fades out after too many overruns.
    last: Contribution,
    /// Weight, priority and fade time.
    pub(super) blend: Blend,
    /// Health of this layer alone: a replacement starts with zero counters.
    pub(super) health: ModelHealth,
    /// Number of replacements of the model up to this layer; 0 for the first layer.
    pub(super) generation: u16,
}

/// Report on a layer after its use.
pub struct LayerReport {
    /// Number of the model in the scene.
    pub model: usize,
    /// Number of replacements of the model up to this layer; 0 for the first layer.
    pub generation: u16,
    /// Health counters of the layer.
    pub health: ModelHealth,
    /// Last message of an unhealthy model; may be empty.
    pub words: String,
}

impl Layer {
    /// Creates a layer from a model's instances, each with its mapping, and their common time budget. Not real-time.
    ///
    /// A model with workspace bounds gets a wall at the bounds, with the largest stable stiffness of the loop up to 7500 N/m.
    pub fn new(
        instances: Vec<(Engine, Mapping)>,
        blend: &Blend,
        budget: TimeBudget,
        sampled: &SampledLoop,
    ) -> Self {
        let serves = instances.first().map_or(Demand::ALL, |(model, _)| model.serves());
        let object = |(mut model, mapping): (Engine, Mapping)| {
            let end = EndWall::new(&model.workspace_bounds(), &mapping, sampled);
            Object { model, mapping, end, last: None, stepped_at: None, float_changes: 0, is_disabled: false }
        };
        let mut objects: Box<[Object]> = instances.into_iter().map(object).collect();
        let bounds = objects.iter_mut().map(Object::bounds).collect();
        let memory = objects.first().map_or(Memory::Stateless, |object| object.model.memory());
        Self {
            objects,
            broad: BroadPhase::new(bounds),
            serves,
            memory,
            budget,
            last: Contribution::NONE,
            blend: *blend,
            health: ModelHealth::default(),
            generation: 0,
        }
    }

    /// Returns the number of replacements of the model up to this layer; 0 for the first layer.
    pub fn generation(&self) -> u16 {
        self.generation
    }

    /// Returns the bounding box, device frame, in which the objects can act; `None` for everywhere. Real-time: bounded by the
    /// number of objects, no allocation.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        self.broad.hull()
    }

    /// Steps the objects near the handle and returns the sum of their contributions, device frame. A model with too many overruns
    /// is not stepped any more: its last contribution fades out.
    ///
    /// Real-time: bounded by the objects that are near, no allocation.
    #[inline(always)] // 3 ns: the result stays in registers
    pub(super) fn step(&mut self, context: &StepContext<'_>, events: &mut Events) -> Contribution {
        let tick = context.tick;
        match self.budget.allowed(tick.time_ns) {
            Allowed::Asked => {
                let (begun_ns, late_answers) = (self.budget.begin(), self.health.late_answers);
                let share = self.ask(context, events);
                if let Some(begun_ns) = begun_ns {
                    let is_there = self.health.late_answers == late_answers;
                    let answer = if is_there { Answer::There } else { Answer::Missing };
                    if self.budget.end(begun_ns, answer, tick.index, tick.time_ns) {
                        events.insert(Events::MODEL_OVERRUN);
                        self.health.overrun = self.budget.overrun();
                    }
                    self.last = share;
                }
                share
            }
            Allowed::Fading(part) => {
                events.insert(Events::MODEL_FAULT);
                self.last.times(part)
            }
            Allowed::Nothing => {
                events.insert(Events::MODEL_FAULT);
                Contribution::NONE
            }
        }
    }

    /// Steps all objects that can act at the handle and returns the sum of their contributions; other objects are not called.
    #[inline]
    fn ask(&mut self, context: &StepContext<'_>, events: &mut Events) -> Contribution {
        let StepContext { tick, state, grip, demand } = *context;
        let Self { objects, broad, serves, memory, health, .. } = self;
        let mut share = Contribution::NONE;
        broad.for_each_near(objects, state.pose.position(), |object| {
            let input = object.mapping.input(tick, state, demand.computed().limited_to(*serves));
            let Some((output, effort)) = object.answer(&input, grip, demand, *memory, health, events) else {
                events.insert(Events::MODEL_FAULT);
                return;
            };
            share.wrench = share.wrench + object.mapping.wrench_to_device(&output.wrench);
            let end = object.end.as_ref();
            if let Some(push) = end.and_then(|end| end.push(&input.pose, &object.mapping, &state.twist)) {
                events.insert(Events::BOUNDARY);
                share.wrench = share.wrench + push;
            }
            share.energy_j += output.energy_j * object.mapping.energy_scale();
            if let Some(grip) = grip {
                share.effort += object.mapping.effort_to_device(grip.kind(), effort);
            }
            if output.status() != Some(StepStatus::Ok) {
                events.insert(Events::MODEL_DEGRADED);
            }
        });
        share
    }

    /// Changes a live parameter of all objects; returns the last status that is not ok. Real-time: bounded by their number, no
    /// allocation.
    pub(super) fn set_parameter(&mut self, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        let mut worst = CallStatus::Ok;
        for (index, object) in self.objects.iter_mut().enumerate() {
            let status = object.model.set_parameter(parameter, value);
            if status == CallStatus::Panicked {
                object.is_disabled = true;
                self.health.panicked_at.get_or_insert(tick.index);
            }
            if status != CallStatus::Ok {
                worst = status;
                continue;
            }
            if let Some(end) = &mut object.end {
                end.move_to(&object.model.workspace_bounds(), &object.mapping);
            }
            if self.broad.bounds(index).is_some() {
                let bounds = object.bounds();
                if bounds != self.broad.bounds(index) {
                    self.broad.watch_always(index, bounds);
                }
            }
        }
        worst
    }

    /// Iterates over the states of the model's instances before a tick; `None` for one whose state cannot be saved. A path-dependent
    /// instance that was not stepped in the last tick is reset first, as before its next step.
    pub(super) fn states(&mut self, tick: u64) -> impl Iterator<Item = Option<InstanceState<'_>>> {
        let memory = self.memory;
        self.objects.iter_mut().map(move |object| {
            let is_ready = object.forget_before(tick, memory);
            object.stepped_at = tick.checked_sub(1);
            object.model.state().filter(|_| is_ready)
        })
    }

    /// Returns a report on the layer of the model numbered `model`. Queries the last message of an unhealthy model only, and calls
    /// `on_query` before the query. Not real-time.
    pub fn report(&mut self, model: usize, on_query: impl FnOnce()) -> LayerReport {
        let (generation, health) = (self.generation, self.health());
        let words = if health.is_good() {
            String::new()
        } else {
            on_query();
            self.last_message()
        };
        LayerReport { model, generation, health, words }
    }

    /// Returns the health counters, with the stiffness of contacts. Not real-time.
    pub(super) fn health(&self) -> ModelHealth {
        let mut health = self.health;
        for Object { model, mapping, .. } in &self.objects {
            let (felt, scale) = (model.felt_stiffness(), mapping.stiffness_scale());
            let contacts = &mut health.contacts;
            contacts.undamped_n_per_m = contacts.undamped_n_per_m.max(felt.undamped_n_per_m * scale);
            let at_hand = felt.reduced_n_per_m.map(|pair| pair.map(|stiffness| stiffness * scale));
            contacts.reduced_n_per_m = contacts.reduced_n_per_m.or(at_hand);
        }
        health
    }

    /// Returns the first non-empty last message of the instances. Not real-time.
    pub(super) fn last_message(&mut self) -> String {
        let mut messages = self.objects.iter_mut().map(|object| object.model.last_message());
        messages.find(|message| !message.is_empty()).unwrap_or_default()
    }
}

impl Object {
    /// Returns the bounding box, device frame, in which the object can act; `None` for everywhere. Real-time: bounded, no allocation.
    fn bounds(&mut self) -> Option<Bounds> {
        let region = self.model.active_region();
        let half_sides_m = match region.shape() {
            RegionShape::Everywhere => return None,
            RegionShape::Sphere => DVec3::splat(self.mapping.length_to_device(region.half_sides().x)),
            RegionShape::Box => self.mapping.half_sides_to_device(region.half_sides()),
        };
        Some(Bounds::about(self.mapping.position_to_device(region.center()), half_sides_m))
    }

    /// Resets a path-dependent model that was not stepped in the tick before `tick`; false if the reset fails. Real-time: bounded by
    /// the model, no allocation.
    #[inline(always)]
    fn forget_before(&mut self, tick: u64, memory: Memory) -> bool {
        let was_inactive = self.stepped_at.is_some_and(|last| last + 1 != tick);
        !(was_inactive && memory == Memory::PathDependent) || self.model.reset() == CallStatus::Ok
    }

    /// Steps the model. Returns output and effort, model frame, if they are usable; otherwise counts the problem in `health`.
    #[inline(always)] // with the three of `Mapping` and `limit_wrench` 22 ns a tick
    fn answer(
        &mut self,
        input: &Input,
        grip: Option<&GripState>,
        demand: TickDemand,
        memory: Memory,
        health: &mut ModelHealth,
        events: &mut Events,
    ) -> Option<(Output, f64)> {
        if self.is_disabled {
            return None;
        }
        if !self.forget_before(input.tick, memory) {
            return self.fail(input.tick, health);
        }
        self.stepped_at = Some(input.tick);
        let mut output = Output::new(Wrench::ZERO, 0.0, StepStatus::Ok);
        let mut grip = grip.map(|state| GripRecord::at(self.mapping.grip_to_model(state)));
        let stepped = self.model.step(input, &mut output, &mut grip);
        if self.model.float_changes() != self.float_changes {
            self.float_changes = self.model.float_changes();
            events.insert(Events::FLOAT_ENVIRONMENT);
            health.float_changes.count(input.tick);
        }
        match stepped {
            Stepped::Answered => {}
            Stepped::Short(Shortcoming::Aged) => health.contacts.aged.count(input.tick),
            Stepped::Short(Shortcoming::Unsolved) => health.contacts.unsolved.count(input.tick),
            Stepped::Refused => health.refused_sets.count(input.tick),
            // The last output replaces one late output; a second late output in a row has no replacement.
            Stepped::Late => {
                events.insert(Events::MODEL_OVERRUN);
                health.late_answers += 1;
                return self.last.take();
            }
            Stepped::Silent => {
                events.insert(Events::MODEL_OVERRUN);
                health.late.count(input.tick);
                return self.last.take();
            }
            Stepped::Broken => return self.fail(input.tick, health),
            Stepped::Gone => {
                self.is_disabled = true;
                health.lost_at.get_or_insert(input.tick);
                return None;
            }
        }
        let effort = grip.map_or(0.0, |grip| grip.model);
        let usable = usable(demand, output).map(|output| (output, effort)).filter(|_| effort.is_finite());
        if usable.is_none() {
            self.last = None;
            health.rejected.count(input.tick);
        } else if self.model.may_be_late() {
            self.last = usable;
        }
        usable
    }

    fn fail(&mut self, tick: u64, health: &mut ModelHealth) -> Option<(Output, f64)> {
        self.is_disabled = true;
        health.panicked_at.get_or_insert(tick);
        None
    }
}
