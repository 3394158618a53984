//! Host side of `flotor.independent-stop/1`: the checked stop of a device, with a duplicate of its handle.

use crate::OpenedDevice;
use crate::platform::{Handle, writable_duplicate};
use flotor_hal::extension::independent_stop::StopMeans;
use flotor_hal::{IndependentStop, Refusal, StoppedState};

/// Checked independent stop of a device.
#[derive(Debug)]
pub enum Independence {
    /// Stop by a message on a duplicated handle.
    Message {
        /// Handle that receives the message.
        handle: Handle,
        /// Message bytes.
        message: Vec<u8>,
        /// State of the stopped device.
        state: StoppedState,
    },
    /// Stop by the device's own controller.
    Itself {
        /// Timeout without a command, ns.
        within_ns: u64,
        /// State of the stopped device.
        state: StoppedState,
    },
}

impl Independence {
    /// Checks a plugin's declaration and duplicates its descriptor; `None` without an independent stop.
    pub(crate) fn of(declared: &IndependentStop) -> Result<Option<Self>, Refusal> {
        let (descriptor, message, state) = match declared.means()? {
            StopMeans::None => return Ok(None),
            StopMeans::Itself { within_ns, state } => return Ok(Some(Self::Itself { within_ns, state })),
            StopMeans::Message { descriptor, message, state } => (descriptor, message.to_vec(), state),
        };
        // SAFETY: the plugin keeps the descriptor open until the device is closed (contract), and the device is open.
        let handle = unsafe { writable_duplicate(descriptor) };
        let handle = handle.map_err(|problem| IndependentStop::refusal(&problem))?;
        Ok(Some(Self::Message { handle, message, state }))
    }
}

impl OpenedDevice {
    /// Returns the independent stop of the device; `None` if there is none. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the plugin's declaration is invalid or missing.
    pub fn independent_stop(&mut self) -> Result<Option<Independence>, Refusal> {
        let ask = self.extensions().independent_stop.and_then(|table| table.independent_stop);
        if ask.is_none() {
            return Ok(None);
        }
        // Invalid initial value, a message without a descriptor: rejected below unless the plugin writes it.
        let unfilled = IndependentStop::by_message(-1, &[0], StoppedState::Zero, 0);
        let Some(declared) = self.calls.query(ask, unfilled) else {
            return Err(Refusal::broken(
                "`independent_stop` of the device plugin failed; \
            declare a stop or remove the extension `flotor.independent-stop/1`",
            ));
        };
        Independence::of(&declared)
    }
}
