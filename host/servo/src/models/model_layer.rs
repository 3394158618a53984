//! One force model with all its instances and its time budget: the unit that is blended, faded and replaced.

use super::body::{Body, Marks};
use super::contribution::Share;
use crate::budget::{Allowed, Answer, TimeBudget};
use flotor_core::health::ModelHealth;
use flotor_core::mapping::Blend;
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Tick};

/// Force model with all its instances.
pub(crate) struct ModelLayer<B: Body> {
    pub(super) body: B,
    /// Outputs that the model can compute.
    pub(super) serves: Demand,
    budget: TimeBudget,
    /// Last contribution, which fades out after too many overruns.
    last: B::Share,
    /// Weight, priority and fade time.
    pub(super) blend: Blend,
    /// Health of this layer alone: a replacement starts with zero counters.
    health: ModelHealth,
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

/// Saved state of a layer, without the states of its instances.
pub(crate) struct SavedLayer<B: Body> {
    budget: TimeBudget,
    last: B::Share,
    health: ModelHealth,
}

impl<B: Body> ModelLayer<B> {
    /// Saves the state; `None` if an instance is disabled. Not real-time.
    pub(super) fn save(&self) -> Option<SavedLayer<B>> {
        let Self { budget, last, health, .. } = self;
        let is_whole = health.panicked_at.is_none() && health.lost_at.is_none();
        is_whole.then(|| SavedLayer { budget: budget.clone(), last: *last, health: *health })
    }

    /// Restores a state; `None` if an instance is disabled. Not real-time.
    pub(super) fn restore(&mut self, saved: &SavedLayer<B>) -> Option<()> {
        self.save()?;
        (self.budget, self.last, self.health) = (saved.budget.clone(), saved.last, saved.health);
        Some(())
    }

    /// Creates a layer from instances that compute the outputs `serves`, with their common time budget. Not real-time.
    pub(super) fn new(body: B, serves: Demand, blend: &Blend, budget: TimeBudget) -> Self {
        Self {
            body,
            serves,
            budget,
            last: B::Share::NONE,
            blend: *blend,
            health: ModelHealth::default(),
            generation: 0,
        }
    }

    /// Steps the instances and returns their contribution, device frame. A model with too many overruns is not stepped any more: its
    /// last contribution fades out.
    ///
    /// Real-time: bounded by the instances, no allocation.
    #[inline(always)] // 3 ns: the result stays in registers
    pub(super) fn step(&mut self, tick: &Tick, samples: &B::Samples<'_>, events: &mut B::Marks) -> B::Share {
        match self.budget.allowed(tick.time_ns) {
            Allowed::Asked => {
                let (begun_ns, late_answers) = (self.budget.begin(), self.health.late_answers);
                let share = self.body.step(tick, samples, &mut self.health, events);
                if let Some(begun_ns) = begun_ns {
                    let is_there = self.health.late_answers == late_answers;
                    let answer = if is_there { Answer::There } else { Answer::Missing };
                    if self.budget.end(begun_ns, answer, tick.index, tick.time_ns) {
                        events.mark(Events::MODEL_OVERRUN);
                        self.health.overrun = self.budget.overrun();
                    }
                    self.last = share;
                }
                share
            }
            Allowed::Fading(part) => {
                events.mark(Events::MODEL_FAULT);
                self.last.times(part)
            }
            Allowed::Nothing => {
                events.mark(Events::MODEL_FAULT);
                B::Share::NONE
            }
        }
    }

    /// Changes a live parameter of all instances; returns the last status that is not ok. Real-time: bounded by their number, no
    /// allocation.
    pub(super) fn set_parameter(&mut self, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        self.body.set_parameter(tick, parameter, value, &mut self.health)
    }

    /// Returns a report on the layer of the model numbered `model`. Queries the last message of an unhealthy model only, and calls
    /// `on_query` before the query. Not real-time.
    pub(super) fn report(&mut self, model: usize, on_query: impl FnOnce()) -> LayerReport {
        let (generation, health) = (self.generation, self.health());
        let words = if health.is_good() {
            String::new()
        } else {
            on_query();
            self.body.last_message()
        };
        LayerReport { model, generation, health, words }
    }

    /// Returns the health counters, with the stiffness of contacts. Not real-time.
    pub(super) fn health(&self) -> ModelHealth {
        self.body.with_stiffness(self.health)
    }
}
