//! Function table of devices that set the pace: `flotor.device-pacing/1`.

use super::Instance;

/// `flotor.device-pacing/1`: offered by a device that can set the pace, see [`crate::Pacing`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DevicePacingTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Blocks until the device has a sample that no earlier wait has told of, or until `timeout_ns` have passed;
    /// writes the number of samples taken since the last wait that found any, 0 after a wait in vain. Returns a
    /// [`super::CallStatus`] code. Real-time but for the waiting: no allocation.
    pub wait_for_sample:
        Option<unsafe extern "C" fn(instance: Instance, timeout_ns: u64, samples: *mut u64) -> u32>,
}
