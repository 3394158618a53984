//! Faults of a running device.

use crate::chip::{ChipLost, ShortPacket};
use flotor_hal::Fault;

/// Fault of a running device. After each fault the motors are set to zero torque, if the device still receives
/// commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceError {
    /// The device was unplugged, or its hub was reset.
    Gone,
    /// Timeout: no report to any command, the chip sends its status bytes alone.
    Silent,
    /// A packet shorter than its two status bytes.
    ShortPacket,
    /// A surplus report: all later reports would be delayed.
    StaleReport,
    /// Malformed data on the serial line.
    Noise,
    /// An arm is not homed: the firmware has restarted.
    NotHomed,
    /// Encoder counts outside the linkage's geometry.
    NoPosture,
}

impl DeviceError {
    /// Returns the corresponding fault of the device contract.
    #[must_use]
    pub const fn fault(self) -> Fault {
        match self {
            Self::Gone => Fault::Disconnected,
            Self::Silent => Fault::Timeout,
            Self::ShortPacket | Self::StaleReport | Self::Noise => Fault::Protocol,
            Self::NotHomed | Self::NoPosture => Fault::SensorOutOfRange,
        }
    }
}

impl From<ChipLost> for DeviceError {
    fn from(_: ChipLost) -> Self {
        Self::Gone
    }
}

impl From<ShortPacket> for DeviceError {
    fn from(_: ShortPacket) -> Self {
        Self::ShortPacket
    }
}
