//! Source of linear fields: a model with the time of its last computation.

use crate::{Engine, Stepped};
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Input, LinearField};

/// Model with the sample time of its last field.
pub(super) struct FieldSource {
    pub(super) model: Engine,
    demand: Demand,
    /// Sample time of the last field, ns; `None` after a reset.
    last_ns: Option<u64>,
}

impl FieldSource {
    /// Creates a source before its first field. Not real-time.
    pub(super) fn new(model: Engine) -> Self {
        Self { demand: model.serves().limited_to(Demand::WRENCH), model, last_ns: None }
    }

    /// Computes the field at an input, with the time since the last field as `dt_ns`; `field` is only valid for [`Stepped::Answered`].
    pub(super) fn compute(&mut self, input: &Input, field: &mut LinearField) -> Stepped {
        let dt_ns = self.last_ns.map_or(0, |last_ns| input.time_ns.saturating_sub(last_ns));
        self.last_ns = Some(input.time_ns);
        *field = LinearField::NONE;
        let stepped = self.model.linear_field(&Input { dt_ns, demand: self.demand, ..*input }, field);
        field.time_ns = input.time_ns;
        stepped
    }

    /// Clears the history of the model.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.last_ns = None;
        self.model.reset()
    }
}
