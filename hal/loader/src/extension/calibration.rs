//! Host side of `flotor.calibration/1`: the serial number of a device, and its correction of the vertical force.

use crate::OpenedDevice;
use flotor_hal::abi::Message;
use flotor_hal::{Refusal, VerticalCalibration};

impl OpenedDevice {
    /// Returns the serial number of the hardware; empty if none or not reported.
    #[must_use]
    pub fn serial(&mut self) -> String {
        let ask = self.extensions().calibration.and_then(|table| table.serial);
        self.calls.query(ask, Message::default()).map_or(String::new(), |serial| serial.as_str().to_owned())
    }

    /// Corrects the total vertical command from the next activation on.
    ///
    /// # Errors
    /// A [`Refusal`] if the device supports no calibration, or rejects this one.
    pub fn calibrate_vertical(&mut self, calibration: &VerticalCalibration) -> Result<(), Refusal> {
        let calibrate = self.extensions().calibration.and_then(|table| table.calibrate_vertical);
        let Some(calibrate) = calibrate else {
            return Err(Refusal::unsupported(
                "this device does not support a calibration of the vertical force; in a scene, remove \
            `calibration`",
            ));
        };
        // SAFETY: a live instance, used by this thread only (`&mut`), pointers valid for the call.
        self.calls.refusable(|instance, message| unsafe { calibrate(instance, calibration, message) })
    }
}
