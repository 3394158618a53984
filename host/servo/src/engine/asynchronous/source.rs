//! Source of local models: a model with the time of its last computation.

use crate::{Engine, Stepped};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Demand, Input};

/// Model with the sample time of its last answer.
pub(super) struct Source {
    pub(super) model: Engine,
    demand: Demand,
    /// Sample time of the last answer, ns; `None` after a reset.
    last_ns: Option<u64>,
}

impl Source {
    /// Creates a source before its first answer. Not real-time.
    pub(super) fn new(model: Engine) -> Self {
        Self { demand: model.serves().limited_to(Demand::WRENCH), model, last_ns: None }
    }

    /// Computes contacts or field at an input, with the time since the last answer as `dt_ns`; `set` is only valid for
    /// [`Stepped::Answered`].
    pub(super) fn compute(&mut self, input: &Input, set: &mut ContactSet) -> Stepped {
        let dt_ns = self.last_ns.map_or(0, |last_ns| input.time_ns.saturating_sub(last_ns));
        self.last_ns = Some(input.time_ns);
        *set = ContactSet::NONE;
        let stepped = self.model.local_model(&Input { dt_ns, demand: self.demand, ..*input }, set);
        (set.time_ns, set.field.time_ns) = (input.time_ns, input.time_ns);
        stepped
    }

    /// Clears the history of the model.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.last_ns = None;
        self.model.reset()
    }
}
