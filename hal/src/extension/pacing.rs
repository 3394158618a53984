//! Extension `flotor.pacing/1`: pacing of the loop by a device: the loop waits for the next sample, not for a clock.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, DeviceAdapter, Instance};
use crate::{ActiveDevice, Device};

/// Result of waiting for a sample.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleWait {
    /// The device does not set the pace.
    NotPaced,
    /// No sample arrived before the timeout.
    TimedOut,
    /// A sample is ready to be read.
    Arrived {
        /// Samples taken since the last successful wait: 1 on time, more if samples were missed.
        samples: u64,
    },
}

impl SampleWait {
    /// Returns the number of samples for the plugin boundary; 0 if no sample arrived.
    const fn samples(self) -> u64 {
        match self {
            Self::NotPaced | Self::TimedOut => 0,
            Self::Arrived { samples } => samples,
        }
    }
}

/// Active device that can set the pace of the loop.
///
/// ```
/// # use flotor_hal::*;
/// # struct Crank { samples: u64, ledger: EnergyLedger }
/// # impl Device for Crank {
/// #     const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that turns");
/// #     type Active = Crank;
/// #     type Stop = NothingToStop;
/// #     fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Crank { samples: 0, ledger: EnergyLedger::default() })
/// #     }
/// #     fn capabilities(&self) -> Capabilities { Capabilities::UNDRIVEN }
/// #     fn stopper(&self) -> NothingToStop { NothingToStop }
/// #     fn activate(self, _: &LoopConfig) -> Result<Crank, (Self, Refusal)> { Ok(self) }
/// # }
/// # impl ActiveDevice for Crank {
/// #     type Opened = Crank;
/// #     fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle { Cycle::Fresh }
/// #     fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle { Cycle::Fresh }
/// #     fn deactivate(self) -> Crank { self }
/// # }
/// /// Samples arrive in a thread of their own, which counts them: `export_device!(Crank, pacing)`.
/// impl PacingDevice for Crank {
///     fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
///         match std::mem::take(&mut self.samples) {
///             // A real device waits here until a sample comes.
///             0 => {
///                 std::thread::sleep(std::time::Duration::from_nanos(timeout_ns));
///                 SampleWait::TimedOut
///             }
///             samples => SampleWait::Arrived { samples },
///         }
///     }
/// }
/// # let mut crank = Crank { samples: 2, ledger: EnergyLedger::default() };
/// assert_eq!(crank.wait_for_sample(0), SampleWait::Arrived { samples: 2 });
/// assert_eq!(crank.wait_for_sample(0), SampleWait::TimedOut);
/// ```
pub trait PacingDevice: ActiveDevice {
    /// Waits for a sample that no earlier wait has reported, for `timeout_ns` at most. Called before each `read` of a
    /// run that the device paces. Real-time except for the wait: no allocation.
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait;
}

/// Function table `flotor.pacing/1`: see [`PacingDevice`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct PacingTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Waits for a sample that no earlier wait has reported, for `timeout_ns` at most; writes the number of samples
    /// taken since the last successful wait, 0 after a timeout. Returns a [`crate::abi::CallStatus`] code. Real-time
    /// except for the wait: no allocation.
    pub wait_for_sample:
        Option<unsafe extern "C" fn(instance: Instance, timeout_ns: u64, samples: *mut u64) -> u32>,
}

layout! {
    PacingTable { size, reserved, wait_for_sample }
}
unsafe extern "C" fn wait_for_sample<D: Device<Active: PacingDevice>>(
    instance: Instance,
    timeout_ns: u64,
    samples: *mut u64,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe {
        fill::<DeviceAdapter<D>, _>(instance, samples, |phase| {
            match phase.active()?.wait_for_sample(timeout_ns) {
                SampleWait::NotPaced => Err(CallStatus::Unsupported),
                waited => Ok(waited.samples()),
            }
        })
    }
}

table!(PacingTable: "flotor.pacing/1", D: [Device<Active: PacingDevice>] {
    reserved: 0,
    wait_for_sample: Some(wait_for_sample::<D>),
});
