//! Host side of `flotor.linear-field/1`: local linear field of an asynchronous model.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, LinearField};

impl Model {
    /// Returns true if the model offers a local linear field.
    #[must_use]
    pub fn has_linear_field(&self) -> bool {
        self.extensions.linear_field.is_some_and(|table| table.linear_field.is_some())
    }

    /// Computes the field at an input; `field` is valid only if the result is [`CallStatus::Ok`]. Not real-time.
    pub fn linear_field(&mut self, input: &Input, field: &mut LinearField) -> CallStatus {
        let Some(ask) = self.extensions.linear_field.and_then(|table| table.linear_field) else {
            return CallStatus::Unsupported;
        };
        // SAFETY: a live instance used by this thread only (`&mut`), pointers valid for the call.
        CallStatus::from_code(self.calls.call(|instance| unsafe { ask(instance, input, field) }))
    }
}
