//! What is left of a run whose devices are de-energised: models and devices, which only the plugins' own code can free.
//!
//! That code may hang or end the process, and nothing of the run depends on it any more. So whoever has a recording to close
//! and a summary to print does that before.

use crate::calls::{Call, CallError, END_LIMIT, Unresponsive, attended};
use flotor_hal::abi::loader::OpenedDevice;
use flotor_servo::{LastStop, Layer};

/// Models and devices of a run that is over. Freed when dropped, or by [`Self::free`], which names who hangs.
#[derive(Default)]
pub struct Remains {
    devices: Vec<(String, OpenedDevice)>,
    models: Vec<(String, Box<Layer>)>,
    /// Last: the process may die of what frees the others.
    _last_stop: Option<LastStop>,
}

impl Remains {
    pub(super) fn new(
        devices: Vec<(String, OpenedDevice)>,
        models: Vec<(String, Box<Layer>)>,
        last_stop: Option<LastStop>,
    ) -> Self {
        Self { devices, models, _last_stop: last_stop }
    }

    /// Closes the devices and frees the models, each for no longer than 5 s. Not real-time.
    ///
    /// # Errors
    /// The first that did not return; its thread is left behind. The others are freed all the same.
    pub fn free(mut self) -> Result<(), Unresponsive> {
        self.free_all()
    }

    fn free_all(&mut self) -> Result<(), Unresponsive> {
        let devices = self.devices.drain(..).map(|(who, device)| free(who, Call::Close, device));
        let mut first = devices.fold(Ok(()), Result::and);
        for (who, layer) in self.models.drain(..) {
            first = first.and(free(who, Call::Destroy, layer));
        }
        first
    }
}

impl Drop for Remains {
    fn drop(&mut self) {
        // Whoever wants to know calls `free`.
        let _ = self.free_all();
    }
}

/// Drops what only the code of a plugin can free.
fn free<T: Send + 'static>(who: String, call: Call, what: T) -> Result<(), Unresponsive> {
    let freed = attended(END_LIMIT, move |progress| {
        progress.enter(&who, call);
        drop(what);
    });
    match freed {
        Err(CallError::Unresponsive(hung)) => Err(hung),
        // Without a thread it was dropped where it was.
        Ok(()) | Err(CallError::NoThread | CallError::Stopped) => Ok(()),
    }
}
