//! Instances of a layer: those of a model on one device, or the one that several devices share.

use super::contribution::Share;
use flotor_core::health::ModelHealth;
use flotor_core::trace::Events;
use flotor_hal::Tick;
use flotor_hal::abi::CallStatus;
use flotor_hal::extension::world::MAX_PORTS;
use flotor_loader::InstanceState;

/// Instances that are stepped, blended and replaced together.
pub(crate) trait Body {
    /// Sample of each device of a step.
    type Samples<'s>;
    /// Contribution at each device.
    type Share: Share;
    /// Events at each device.
    type Marks: Marks;

    /// Steps the instances; counts problems in `health`. Real-time: bounded by the instances, no allocation.
    fn step(
        &mut self,
        tick: &Tick,
        samples: &Self::Samples<'_>,
        health: &mut ModelHealth,
        events: &mut Self::Marks,
    ) -> Self::Share;

    /// Changes a live parameter of all instances; returns the last status that is not ok. Real-time: bounded by their number, no
    /// allocation.
    fn set_parameter(
        &mut self,
        tick: &Tick,
        parameter: usize,
        value: f64,
        health: &mut ModelHealth,
    ) -> CallStatus;

    /// Returns the present values of the parameters, which all instances have in common. Not real-time.
    fn parameters(&mut self) -> Vec<f64>;

    /// Iterates over the states of the instances before a tick; `None` for one whose state cannot be saved. A path-dependent
    /// instance that was not stepped in the last tick is reset first, as before its next step.
    fn states(&mut self, tick: u64) -> impl Iterator<Item = Option<InstanceState<'_>>>;

    /// Adds the stiffness of contacts to the health counters. Not real-time.
    fn with_stiffness(&self, health: ModelHealth) -> ModelHealth;

    /// Returns the first non-empty last message of the instances. Not real-time.
    fn last_message(&mut self) -> String;
}

/// Events of a tick, at one device or at each of several.
pub(crate) trait Marks {
    /// Inserts an event at every device. Real-time: bounded, no allocation.
    fn mark(&mut self, event: Events);
}

impl Marks for Events {
    #[inline]
    fn mark(&mut self, event: Events) {
        self.insert(event);
    }
}

impl Marks for [Events; MAX_PORTS] {
    fn mark(&mut self, event: Events) {
        self.iter_mut().for_each(|events| events.insert(event));
    }
}
