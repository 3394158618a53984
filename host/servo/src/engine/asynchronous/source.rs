//! Source of local models: a model with the time of its last computation.

use crate::{Engine, Stepped};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Demand, Input, MAX_PORTS};

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

    /// Computes contacts or field at the newest input of each port, with the time since the last answer as `dt_ns`; `sets`, one for
    /// each input, are only valid for [`Stepped::Answered`].
    pub(super) fn compute(&mut self, inputs: &[Input], sets: &mut [ContactSet]) -> Stepped {
        let now_ns = inputs.iter().map(|input| input.time_ns).max().unwrap_or_default();
        let dt_ns = self.last_ns.map_or(0, |last_ns| now_ns.saturating_sub(last_ns));
        self.last_ns = Some(now_ns);
        let mut asked = [Input::at_rest(flotor_hal::Pose::HOME); MAX_PORTS];
        for (asked, input) in asked.iter_mut().zip(inputs) {
            *asked = Input { dt_ns, demand: self.demand, ..*input };
        }
        let asked = asked.get(..inputs.len()).unwrap_or(&asked);
        sets.fill(ContactSet::NONE);
        let stepped = self.model.local_models(asked, sets);
        for (set, input) in sets.iter_mut().zip(inputs) {
            (set.time_ns, set.field.time_ns) = (input.time_ns, input.time_ns);
        }
        stepped
    }

    /// Clears the history of the model.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.last_ns = None;
        self.model.reset()
    }
}
