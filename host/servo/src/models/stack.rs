//! Force models of one device, and the priorities of all models that act on it.

use super::contribution::{Contribution, Sample, Share};
use super::model_layer::ModelLayer;
use super::objects::Objects;
use super::slot::Slot;
use crate::{Heartbeat, Place};
use flotor_core::broad_phase::BroadPhase;
use flotor_core::trace::Events;
use flotor_core::weight::Fade;
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Demand, Tick};

/// Time over which layers of lower priority fade out and in again, s: shorter than a hand's reaction, and long enough that the slew
/// limit need not act.
const SILENCE_S: f64 = 0.02;

/// Models of a device.
pub(crate) struct ModelStack {
    /// Slots of the models, in the scene's order.
    pub(crate) slots: Box<[Slot<Objects>]>,
    broad: BroadPhase,
    /// Levels by ascending priority; empty if all layers have the same priority: then no layer is silenced.
    levels: Box<[Level]>,
    observable: Demand,
    /// Outputs that all shared models of the device have.
    pub(super) shared_observable: Demand,
}

/// Returns the outputs that the sum of the models has: energy only if every model computes its energy.
fn observable(slots: &[Slot<Objects>]) -> Demand {
    if slots.iter().all(Slot::gives_energy) { Demand::ALL } else { Demand::WRENCH }
}

/// Gain and activity of the layers of one priority.
struct Level {
    priority: u8,
    gain: Fade,
    /// True if a layer of this priority had a nonzero wrench in this tick.
    pushes: bool,
}

impl Level {
    /// Returns the weight of a layer of this level, and notes if its contribution reaches the hand.
    #[inline]
    fn weigh(&mut self, weight: f64, share: &Contribution, at_hand: Demand, time_ns: u64) -> f64 {
        self.pushes |= weight > 0.0 && reaches_hand(share, at_hand);
        weight * self.gain.at(time_ns)
    }
}

impl ModelStack {
    /// Creates the stack from layers, each with the number of its model in the scene; `shared` are the priorities of the shared
    /// models on the device. Not real-time.
    pub(crate) fn new(layers: Vec<(usize, Box<ModelLayer<Objects>>)>, shared: &[u8]) -> Self {
        let slots: Box<[Slot<Objects>]> =
            layers.into_iter().map(|(number, layer)| Slot::new(number, layer)).collect();
        let broad = BroadPhase::new(slots.iter().map(Slot::bounds).collect());
        let mut priorities: Vec<u8> =
            slots.iter().map(|slot| slot.priority).chain(shared.iter().copied()).collect();
        priorities.sort_unstable();
        priorities.dedup();
        if priorities.len() == 1 {
            priorities.clear();
        }
        let level = |priority| Level { priority, gain: Fade::new(1.0, SILENCE_S), pushes: false };
        let observable = observable(&slots);
        let levels = priorities.into_iter().map(level).collect();
        Self { slots, broad, levels, observable, shared_observable: Demand::ALL }
    }

    /// Returns the gains of the levels, to save or restore them. Not real-time.
    pub(crate) fn gains(&mut self) -> impl Iterator<Item = &mut Fade> {
        self.levels.iter_mut().map(|level| &mut level.gain)
    }

    /// Returns the outputs that the sum of the models has: energy only if every model computes its energy. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(crate) fn observable(&self) -> Demand {
        self.observable.limited_to(self.shared_observable)
    }

    /// Steps the models near the handle; returns the weighted sum of their contributions.
    /// An output without demand is undefined; an output that only observers demand is NaN if it is not finite.
    ///
    /// Real-time: bounded by the models that are near, no allocation.
    #[inline]
    pub(crate) fn step(
        &mut self,
        tick: &Tick,
        sample: &Sample<'_>,
        heartbeat: &Heartbeat,
        events: &mut Events,
    ) -> Contribution {
        let Self { slots, broad, levels, .. } = self;
        let mut sum = Contribution::NONE;
        broad.for_each_near(slots, sample.state.pose.position(), |slot| {
            let level = levels.iter_mut().find(|level| level.priority == slot.priority);
            let is_silenced = level.as_ref().is_some_and(|level| level.gain.is_silent(tick.time_ns));
            if is_silenced || slot.weight.is_silent(tick.time_ns) {
                return;
            }
            heartbeat.enter(tick.index, Place::Model(slot.number));
            let share = slot.step(tick, sample, events);
            let mut weight = slot.weight.at(tick.time_ns);
            if let Some(level) = level {
                weight = level.weigh(weight, &share, sample.demand.at_hand(), tick.time_ns);
            }
            sum = sum.plus(share.times(weight));
        });
        heartbeat.enter(tick.index, Place::Host);
        sum
    }

    /// Returns the weight at this device of a shared model of a priority, for its contribution in this tick. Real-time: bounded, no
    /// allocation.
    pub(super) fn weigh(
        &mut self,
        priority: u8,
        weight: f64,
        share: &Contribution,
        at_hand: Demand,
        tick: &Tick,
    ) -> f64 {
        let level = self.levels.iter_mut().find(|level| level.priority == priority);
        level.map_or(weight, |level| level.weigh(weight, share, at_hand, tick.time_ns))
    }

    /// Sets the levels to fade out or in, after all models of the device have been stepped. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn settle(&mut self, tick: &Tick) {
        let mut is_silenced = false;
        for level in self.levels.iter_mut().rev() {
            level.gain.set_target(if is_silenced { 0.0 } else { 1.0 }, tick.time_ns);
            is_silenced |= std::mem::take(&mut level.pushes);
        }
    }

    /// Changes a live parameter of the model at index `model` of the stack; unsupported if there is no such model. Real-time:
    /// bounded by the model's objects, no allocation.
    pub(crate) fn set_parameter(
        &mut self,
        model: usize,
        tick: &Tick,
        parameter: usize,
        value: f64,
    ) -> CallStatus {
        let Some(slot) = self.slots.get_mut(model) else { return CallStatus::Unsupported };
        let status = slot.set_parameter(tick, parameter, value);
        self.rebound(model);
        status
    }

    /// Replaces a model; the new layer fades in from this tick on. Returns an older layer that was still fading out (or the new
    /// layer if there is no such model), to be dropped outside the loop.
    ///
    /// Real-time: bounded by the objects of the model, no allocation.
    pub(crate) fn replace(
        &mut self,
        model: usize,
        layer: Box<ModelLayer<Objects>>,
        generation: u16,
        tick: &Tick,
    ) -> Option<Box<ModelLayer<Objects>>> {
        let Some(slot) = self.slots.get_mut(model) else { return Some(layer) };
        let pushed_out = slot.put(layer, generation, tick);
        self.observable = observable(&self.slots);
        self.rebound(model);
        pushed_out
    }

    /// Updates the bounds of a layer in the broad phase.
    fn rebound(&mut self, model: usize) {
        let bounds = self.slots.get(model).and_then(Slot::bounds);
        if bounds != self.broad.bounds(model) {
            self.broad.watch_always(model, bounds);
        }
    }
}

/// Returns true if a nonzero part of the contribution reaches the hand.
#[inline]
fn reaches_hand(share: &Contribution, at_hand: Demand) -> bool {
    let Contribution { wrench, effort, .. } = share;
    wrench.force() != DVec3::ZERO
        || at_hand.contains(Demand::TORQUE) && wrench.torque() != DVec3::ZERO
        || *effort != 0.0
}
