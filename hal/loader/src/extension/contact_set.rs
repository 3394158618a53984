//! Host side of `flotor.contact-set/1`: contacts of the tool, from an asynchronous model.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Input};

impl Model {
    /// Returns true if the model offers contact sets.
    #[must_use]
    pub fn has_contact_set(&self) -> bool {
        self.extensions.contact_set.is_some_and(|table| table.contact_set.is_some())
    }

    /// Computes the contacts at an input; `set` is valid only if the result is [`CallStatus::Ok`]. Not real-time.
    pub fn contact_set(&mut self, input: &Input, set: &mut ContactSet) -> CallStatus {
        let Some(ask) = self.extensions.contact_set.and_then(|table| table.contact_set) else {
            return CallStatus::Unsupported;
        };
        // SAFETY: a live instance used by this thread only (`&mut`), pointers valid for the call.
        CallStatus::from_code(self.calls.call(|instance| unsafe { ask(instance, input, set) }))
    }

    /// Returns true if the model can run asynchronously: it offers contact sets, for one port or for several, or a local linear
    /// field.
    #[must_use]
    pub fn has_local_model(&self) -> bool {
        self.has_contact_set() || self.has_world_contacts() || self.has_linear_field()
    }

    /// Computes the contacts at an input; for a model without them a set with the local linear model as its bilateral part.
    /// `set` is valid only if the result is [`CallStatus::Ok`]. Not real-time.
    pub fn local_model(&mut self, input: &Input, set: &mut ContactSet) -> CallStatus {
        *set = ContactSet::NONE;
        if self.has_contact_set() {
            self.contact_set(input, set)
        } else if self.has_world_contacts() {
            self.contact_sets(std::slice::from_ref(input), std::slice::from_mut(set))
        } else {
            set.has_field = 1;
            self.linear_field(input, &mut set.field)
        }
    }
}
