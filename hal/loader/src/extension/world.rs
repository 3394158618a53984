//! Host side of `flotor.world/1`: one object at the ports of several devices.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, Output};

impl Model {
    /// Returns true if several devices can share an instance of the model.
    #[must_use]
    pub fn has_ports(&self) -> bool {
        self.extensions.world.is_some_and(|table| table.step_ports.is_some())
    }

    /// Steps the model once for all its ports, up to the length of the shorter slice; `outputs` are valid only if the result
    /// is [`CallStatus::Ok`]. Real-time: bounded by the model, no allocation.
    pub fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) -> CallStatus {
        let Some(step) = self.extensions.world.and_then(|table| table.step_ports) else {
            return CallStatus::Unsupported;
        };
        let Ok(count) = u32::try_from(inputs.len().min(outputs.len())) else { return CallStatus::OutOfRange };
        let (inputs, outputs) = (inputs.as_ptr(), outputs.as_mut_ptr());
        // SAFETY: a live instance used by this thread only (`&mut`); both slices hold at least `count` structs and do not
        // overlap (`&`, `&mut`).
        CallStatus::from_code(self.calls.call(|instance| unsafe { step(instance, count, inputs, outputs) }))
    }
}
