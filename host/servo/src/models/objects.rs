//! Instances of a model on one device, one for each of its positions.

use super::body::Body;
use super::contribution::{Contribution, Sample, Share, usable};
use super::instance::{Instance, Usable};
use super::placement::Placement;
use crate::engine::{Engine, Stepped};
use flotor_core::broad_phase::{Bounds, BroadPhase};
use flotor_core::demand::TickDemand;
use flotor_core::grip::GripRecord;
use flotor_core::health::ModelHealth;
use flotor_core::mapping::Mapping;
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    DVec3, Demand, GripState, Input, Memory, Output, RegionShape, SampledLoop, StepStatus, Tick, Wrench,
};
use flotor_loader::InstanceState;

/// One instance of a model with its mapping.
struct Object {
    instance: Instance,
    placement: Placement,
    /// Usable output and effort of the last tick, in the model frame, kept for an engine whose next output may be late.
    last: Option<(Output, f64)>,
}

/// Instances of a model on one device.
pub(crate) struct Objects {
    objects: Box<[Object]>,
    broad: BroadPhase,
    serves: Demand,
    memory: Memory,
}

impl Objects {
    /// Creates the instances, each with its mapping; returns them with the outputs that they can compute. Not real-time.
    pub(super) fn new(instances: Vec<(Engine, Mapping)>, sampled: &SampledLoop) -> (Self, Demand) {
        let object = |(mut model, mapping): (Engine, Mapping)| {
            let placement = Placement::new(&mut model, mapping, sampled);
            Object { instance: Instance::new(model), placement, last: None }
        };
        let mut objects: Box<[Object]> = instances.into_iter().map(object).collect();
        let bounds = objects.iter_mut().map(Object::bounds).collect();
        let first =
            objects.first().map(|object| (object.instance.model.serves(), object.instance.model.memory()));
        let (serves, memory) = first.unwrap_or((Demand::ALL, Memory::Stateless));
        (Self { objects, broad: BroadPhase::new(bounds), serves, memory }, serves)
    }

    /// Returns the bounding box, device frame, in which the objects can act; `None` for everywhere. Real-time: bounded by the
    /// number of objects, no allocation.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        self.broad.hull()
    }
}

impl Body for Objects {
    type Samples<'s> = Sample<'s>;
    type Share = Contribution;
    type Marks = Events;

    /// Steps all objects that can act at the handle and returns the sum of their contributions; other objects are not called.
    #[inline]
    fn step(
        &mut self,
        tick: &Tick,
        sample: &Sample<'_>,
        health: &mut ModelHealth,
        events: &mut Events,
    ) -> Contribution {
        let Sample { state, grip, demand } = *sample;
        let Self { objects, broad, serves, memory } = self;
        let mut share = Contribution::NONE;
        broad.for_each_near(objects, state.pose.position(), |object| {
            let input = object.placement.mapping.input(tick, state, demand.computed().limited_to(*serves));
            let Some((output, effort)) = object.answer(&input, grip, demand, *memory, health, events) else {
                events.insert(Events::MODEL_FAULT);
                return;
            };
            object.placement.add_to(&mut share, (&output, effort), &input, sample, events);
        });
        share
    }

    fn set_parameter(
        &mut self,
        tick: &Tick,
        parameter: usize,
        value: f64,
        health: &mut ModelHealth,
    ) -> CallStatus {
        let mut worst = CallStatus::Ok;
        for (index, object) in self.objects.iter_mut().enumerate() {
            let status = object.instance.set_parameter(tick, parameter, value, health);
            if status != CallStatus::Ok {
                worst = status;
                continue;
            }
            object.placement.move_end(&mut object.instance.model);
            if self.broad.bounds(index).is_some() {
                let bounds = object.bounds();
                if bounds != self.broad.bounds(index) {
                    self.broad.watch_always(index, bounds);
                }
            }
        }
        worst
    }

    fn parameters(&mut self) -> Vec<f64> {
        self.objects.first_mut().map_or_else(Vec::new, |object| object.instance.model.parameters())
    }

    fn states(&mut self, tick: u64) -> impl Iterator<Item = Option<InstanceState<'_>>> {
        let memory = self.memory;
        self.objects.iter_mut().map(move |object| object.instance.state(tick, memory))
    }

    fn with_stiffness(&self, mut health: ModelHealth) -> ModelHealth {
        for Object { instance, placement, .. } in &self.objects {
            placement.note_stiffness(&instance.model.felt_stiffness(0), &mut health.contacts);
        }
        health
    }

    fn last_message(&mut self) -> String {
        let mut messages = self.objects.iter_mut().map(|object| object.instance.model.last_message());
        messages.find(|message| !message.is_empty()).unwrap_or_default()
    }
}

impl Object {
    /// Returns the bounding box, device frame, in which the object can act; `None` for everywhere. Real-time: bounded, no allocation.
    fn bounds(&mut self) -> Option<Bounds> {
        let (region, mapping) = (self.instance.model.active_region(), &self.placement.mapping);
        let half_sides_m = match region.shape() {
            RegionShape::Everywhere => return None,
            RegionShape::Sphere => DVec3::splat(mapping.length_to_device(region.half_sides().x)),
            RegionShape::Box => mapping.half_sides_to_device(region.half_sides()),
        };
        Some(Bounds::about(mapping.position_to_device(region.center()), half_sides_m))
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
        let Self { instance, placement, last } = self;
        if !instance.begin(input.tick, memory, health) {
            return None;
        }
        let mut output = Output::new(Wrench::ZERO, 0.0, StepStatus::Ok);
        let mut grip = grip.map(|state| GripRecord::at(placement.mapping.grip_to_model(state)));
        let stepped = instance.model.step(input, &mut output, &mut grip);
        if instance.has_changed_floats(input.tick, health) {
            events.insert(Events::FLOAT_ENVIRONMENT);
        }
        if stepped != Stepped::Answered {
            match instance.count(stepped, input.tick, health) {
                Usable::Output => {}
                // The last output replaces one late output; a second late output in a row has no replacement.
                Usable::Last => {
                    events.insert(Events::MODEL_OVERRUN);
                    return last.take();
                }
                Usable::Nothing => return None,
            }
        }
        let effort = grip.map_or(0.0, |grip| grip.model);
        let usable = if effort.is_finite() { usable(demand, output) } else { None };
        let Some(output) = usable else {
            return self.reject(input.tick, health);
        };
        if instance.model.may_be_late() {
            *last = Some((output, effort));
        }
        Some((output, effort))
    }

    /// Counts an output that cannot be used; no later one is replaced by it.
    #[inline(never)] // seldom called
    fn reject(&mut self, tick: u64, health: &mut ModelHealth) -> Option<(Output, f64)> {
        self.last = None;
        health.rejected.count(tick);
        None
    }
}
