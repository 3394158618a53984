//! Faults of a running device.

use crate::chip::{ChipLost, ShortPacket};
use flotor_hal::Fault;

/// Fault of a running device; after each the motors are set to rest, if the device still receives commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceError {
    /// The device was unplugged, or its hub was reset.
    Gone,
    /// No report to any command: the chip sends its status bytes alone.
    Silent,
    /// A packet without status bytes.
    ShortPacket,
    /// A surplus report: all further ones would be late.
    StaleReport,
    /// Malformed data on the serial line.
    Noise,
    /// An arm is not homed: the firmware has restarted.
    NotHomed,
    /// Encoder counts outside the linkage's geometry.
    NoPosture,
}

impl DeviceError {
    /// Returns the fault of the contract that the host receives.
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
