//! Function table of the device extension `flotor.calibration/1`.

use super::{Instance, Message};
use crate::VerticalCalibration;

/// `flotor.calibration/1`: see [`VerticalCalibration`]. Both calls belong to the opened phase.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CalibrationTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Serial number of the piece of hardware, empty if it has none; a [`super::CallStatus`] code. Not real-time.
    pub serial: Option<unsafe extern "C" fn(instance: Instance, serial: *mut Message) -> u32>,
    /// Corrects the total vertical command from the next activation on; 0 or a [`crate::RefusalKind`] with the
    /// reason in the message. Not real-time.
    pub calibrate_vertical: Option<
        unsafe extern "C" fn(
            instance: Instance,
            calibration: *const VerticalCalibration,
            message: *mut Message,
        ) -> u32,
    >,
}
