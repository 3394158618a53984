//! Host side of `flotor.pacing/1`: waits for the next sample of a device that sets the pace of the loop.

use crate::{ActiveDevice, OpenedDevice};
use flotor_hal::SampleWait;
use flotor_hal::abi::CallStatus;

impl OpenedDevice {
    /// Returns true if the device can set the pace of the loop.
    #[must_use]
    pub fn can_pace(&self) -> bool {
        self.extensions().pacing.is_some_and(|table| table.wait_for_sample.is_some())
    }
}

impl ActiveDevice {
    /// Waits for the device's next sample, for `timeout_ns` at most; a failed call counts as a timeout. Real-time
    /// except for the wait: no allocation.
    pub fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        let pacing = self.extensions().and_then(|extensions| extensions.pacing);
        let Some(wait) = pacing.and_then(|table| table.wait_for_sample) else { return SampleWait::NotPaced };
        let mut samples = 0;
        // SAFETY: a live, active instance used by this thread only (`&mut`), an out pointer valid for the call.
        let code = self.calls.call(|instance| unsafe { wait(instance, timeout_ns, &raw mut samples) });
        match CallStatus::from_code(code) {
            CallStatus::Ok if samples > 0 => SampleWait::Arrived { samples },
            CallStatus::Unsupported => SampleWait::NotPaced,
            _ => SampleWait::TimedOut,
        }
    }
}
