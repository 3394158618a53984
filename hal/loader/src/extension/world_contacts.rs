//! Host side of `flotor.world-contacts/1`: contacts at the ports of several devices, from one asynchronous model.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Input};

impl Model {
    /// Returns true if several devices can share an asynchronous instance of the model.
    #[must_use]
    pub fn has_world_contacts(&self) -> bool {
        self.extensions.world_contacts.is_some_and(|table| table.contact_sets.is_some())
    }

    /// Computes the contacts at all ports, up to the length of the shorter slice; `sets` are valid only if the result is
    /// [`CallStatus::Ok`]. Not real-time.
    pub fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]) -> CallStatus {
        let Some(ask) = self.extensions.world_contacts.and_then(|table| table.contact_sets) else {
            return CallStatus::Unsupported;
        };
        sets.fill(ContactSet::NONE);
        let Ok(count) = u32::try_from(inputs.len().min(sets.len())) else { return CallStatus::OutOfRange };
        let (inputs, sets) = (inputs.as_ptr(), sets.as_mut_ptr());
        // SAFETY: a live instance used by this thread only (`&mut`); both slices hold at least `count` structs and do not
        // overlap (`&`, `&mut`).
        CallStatus::from_code(self.calls.call(|instance| unsafe { ask(instance, count, inputs, sets) }))
    }

    /// Computes the contacts at one port as [`Self::local_model`] does, or at several as [`Self::contact_sets`]. Not real-time.
    pub fn local_models(&mut self, inputs: &[Input], sets: &mut [ContactSet]) -> CallStatus {
        match (inputs, &mut *sets) {
            ([input], [set]) => self.local_model(input, set),
            _ => self.contact_sets(inputs, sets),
        }
    }
}
