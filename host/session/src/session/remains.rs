//! What is left of a run whose devices are de-energised: models and devices, which only the plugins' own code can free.
//!
//! That code may hang or end the process, and nothing of the run depends on it any more. So whoever has a recording to close
//! and a summary to print does that before.

use crate::calls::{Call, CallError, EndCalls, Unresponsive, end_limit};
use flotor_hal::abi::loader::OpenedDevice;
use flotor_servo::{LastStop, Layer};

/// Models and devices of a run that is over. Freed when dropped, or by [`Self::free`], which names who hangs.
#[derive(Default)]
pub struct Remains {
    devices: Vec<(String, OpenedDevice)>,
    models: Vec<(String, Box<Layer>)>,
    /// Holds the devices too, and closes one that nobody else holds.
    last_stop: Option<LastStop>,
    calls: EndCalls,
}

impl Remains {
    pub(super) fn new(
        devices: Vec<(String, OpenedDevice)>,
        models: Vec<(String, Box<Layer>)>,
        last_stop: Option<LastStop>,
        calls: EndCalls,
    ) -> Self {
        Self { devices, models, last_stop, calls }
    }

    /// Closes the devices and frees the models, each for no longer than 5 s. Not real-time.
    ///
    /// # Errors
    /// The first that did not return; its thread is left behind. The others are freed all the same.
    pub fn free(mut self) -> Result<(), Unresponsive> {
        self.free_all()
    }

    fn free_all(&mut self) -> Result<(), Unresponsive> {
        // Nothing is energised any more. Of a device whose plugin broke this is all that is left.
        let mut first = free(&mut self.calls, "a device".to_owned(), Call::Close, self.last_stop.take());
        for (who, device) in self.devices.drain(..) {
            first = first.and(free(&mut self.calls, who, Call::Close, device));
        }
        for (who, layer) in self.models.drain(..) {
            first = first.and(free(&mut self.calls, who, Call::Destroy, layer));
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
fn free<T: Send + 'static>(
    calls: &mut EndCalls,
    who: String,
    call: Call,
    what: T,
) -> Result<(), Unresponsive> {
    let freed = calls.attended(end_limit(), move |progress| {
        progress.enter(&who, call);
        drop(what);
    });
    match freed {
        Err(CallError::Unresponsive(hung)) => Err(hung),
        // Without a thread it was dropped where it was.
        Ok(()) | Err(CallError::NoThread | CallError::Stopped) => Ok(()),
    }
}
