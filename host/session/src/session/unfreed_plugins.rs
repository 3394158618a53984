//! Plugin instances of a finished run: models and de-energised devices, which only plugin code can free.
//!
//! Plugin code may hang or end the process. So recordings should be closed and summaries printed before the instances are freed.

use crate::calls::{Call, CallError, CallThread, Unresponsive};
use flotor_loader::OpenedDevice;
use flotor_servo::{LastStop, Layer};

/// Models and devices of a finished run. Dropping the value frees models and devices; [`Self::free`] also reports a plugin that
/// hangs.
#[derive(Default)]
pub struct UnfreedPlugins {
    pub(super) devices: Vec<(String, OpenedDevice)>,
    pub(super) models: Vec<(String, Layer)>,
    /// Also owns the devices, and closes a device that has no other owner.
    pub(super) last_stop: Option<LastStop>,
    pub(super) calls: CallThread,
}

impl UnfreedPlugins {
    /// Closes the devices and frees the models, each for no longer than 5 s. Not real-time.
    ///
    /// # Errors
    /// The first plugin that did not return; its thread is abandoned. The other plugins are freed nevertheless.
    pub fn free(mut self) -> Result<(), Unresponsive> {
        self.free_all()
    }

    fn free_all(&mut self) -> Result<(), Unresponsive> {
        // Nothing is energised any more. For a device whose plugin failed, this is the only owner left.
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

impl Drop for UnfreedPlugins {
    fn drop(&mut self) {
        // `free` returns the error.
        let _ = self.free_all();
    }
}

/// Drops a value that only plugin code can free.
fn free<T: Send + 'static>(
    calls: &mut CallThread,
    who: String,
    call: Call,
    what: T,
) -> Result<(), Unresponsive> {
    let freed = calls.run_to_end(move |progress| {
        progress.enter(&who, call);
        drop(what);
    });
    match freed {
        Err(CallError::Unresponsive(hung)) => Err(hung),
        // Without a thread the value was dropped here.
        Ok(()) | Err(CallError::NoThread | CallError::Stopped) => Ok(()),
    }
}
