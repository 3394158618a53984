//! What goes wrong while the device runs.

use crate::chip::{ChipLost, ShortPacket};
use flotor_hal::Fault;

/// What went wrong, as a closed set; after each the motors are at rest, if the device still listens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// It was unplugged, or its hub was reset.
    Gone,
    /// The chip sends its status alone: no report to any command.
    Silent,
    /// A packet has no status.
    ShortPacket,
    /// A report came that no command was sent for: those to come would be old ones.
    StaleReport,
    /// What comes down the line are no reports.
    Noise,
    /// An arm counts from nowhere: the firmware has begun anew.
    NotHomed,
    /// The counts are none that the linkage can have.
    NoPosture,
}

impl Trouble {
    /// What a host is told.
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

impl From<ChipLost> for Trouble {
    fn from(_: ChipLost) -> Self {
        Self::Gone
    }
}

impl From<ShortPacket> for Trouble {
    fn from(_: ShortPacket) -> Self {
        Self::ShortPacket
    }
}
