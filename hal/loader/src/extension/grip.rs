//! Host side of `flotor.grip/1`: the axis between the fingers of a device, and the effort of a model at it.

use crate::{ActiveDevice, Model, OpenedDevice};
use flotor_hal::abi::CallStatus;
use flotor_hal::{GripAxis, GripKind, GripState, Input, Refusal};

impl OpenedDevice {
    /// Returns the grip of the device; `None` without one. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the declaration cannot be enforced.
    pub fn grip_axis(&mut self) -> Result<Option<GripAxis>, Refusal> {
        let table = self.extensions().grip;
        let Some(axis) = self
            .calls
            .query(table.and_then(|table| table.axis), GripAxis::new(GripKind::Linear, [0.0; 2], 0.0))
        else {
            return Ok(None);
        };
        axis.check().map(|()| Some(axis))
    }
}

impl ActiveDevice {
    /// Reads the sample of a grip of this kind that the last [`Self::read`] took; `None` if the plugin failed. Real-time:
    /// bounded by the device, no allocation.
    pub fn read_grip(&mut self, kind: GripKind) -> Option<GripState> {
        let read = self.extensions()?.grip?.read;
        let GripState { opening, velocity, delivered, .. } =
            self.calls.query(read, GripState::new(kind, f64::NAN, f64::NAN))?;
        Some(GripState::new(kind, opening, velocity).with_delivered(delivered))
    }

    /// Sets the effort that the next [`Self::write`] commands; false if the plugin failed. Real-time: bounded by the
    /// device, no allocation.
    #[must_use]
    #[inline(never)] // few devices have one
    pub fn write_grip(&mut self, effort: f64) -> bool {
        let grip = self.extensions().and_then(|extensions| extensions.grip);
        let Some(write) = grip.and_then(|table| table.write) else { return false };
        // SAFETY: a live, active instance used by this thread only (`&mut`).
        CallStatus::Ok as u32 == self.calls.call(|instance| unsafe { write(instance, effort) })
    }
}

impl Model {
    /// Returns the effort at a grip, after the step with the same input; 0 without the extension, NaN if the plugin
    /// failed. Real-time: bounded by the model, no allocation.
    #[must_use]
    pub fn grip(&mut self, input: &Input, grip: &GripState) -> f64 {
        let Some(ask) = self.extensions.grip.and_then(|table| table.effort) else { return 0.0 };
        let mut effort = f64::NAN;
        // SAFETY: a live instance used by this thread only (`&mut`), pointers valid for the call.
        let code = self.calls.call(|instance| unsafe { ask(instance, input, grip, &raw mut effort) });
        if code == CallStatus::Ok as u32 { effort } else { f64::NAN }
    }
}
