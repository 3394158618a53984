//! Interruptions and disturbances of a sitting, as an ethics board asks for them.

use serde::{Deserialize, Serialize};
use std::fmt;

/// An interruption or a disturbance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "incident", rename_all = "kebab-case")]
pub enum Incident {
    /// The emergency stop was pressed.
    EmergencyStop {
        /// Where: key, signal, window, device.
        source: String,
    },
    /// The run ended by itself, or could not go on.
    RunEnded {
        /// Why.
        reason: String,
    },
    /// The window in front of the person was closed, or standard input was.
    WindowClosed,
    /// Somebody pressed the key that stops the sitting.
    Stopped,
    /// The program was asked to end: by a signal, or by a program that watches.
    Signal,
    /// The handle was pushed back at the edge of its range.
    OutOfRange,
    /// Ticks of the servo were missed.
    MissedTicks {
        /// How many.
        ticks: u64,
    },
    /// The system's time of day was set; times of the sitting go on without a jump.
    TimeOfDaySet {
        /// How far forward, ms.
        by_ms: i64,
    },
    /// The sitting broke off without a line of its own: the process was killed, or the power failed. Written when it goes on.
    Killed,
    /// The movement of a trial could not be recorded; the sitting went on.
    NotRecorded {
        /// Why.
        reason: String,
    },
}

impl Incident {
    /// Returns true if the sitting is over until it is resumed.
    pub(super) fn ends_the_sitting(&self) -> bool {
        match self {
            Self::EmergencyStop { .. }
            | Self::RunEnded { .. }
            | Self::WindowClosed
            | Self::Stopped
            | Self::Signal
            | Self::Killed => true,
            Self::OutOfRange
            | Self::MissedTicks { .. }
            | Self::TimeOfDaySet { .. }
            | Self::NotRecorded { .. } => false,
        }
    }
}

impl fmt::Display for Incident {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmergencyStop { source } => write!(f, "emergency stop ({source})"),
            Self::RunEnded { reason } => write!(f, "the run ended: {reason}"),
            Self::WindowClosed => f.write_str("the window was closed"),
            Self::Stopped => f.write_str("stopped at the keyboard"),
            Self::Signal => f.write_str("asked to end, by a signal or a client"),
            Self::OutOfRange => f.write_str("the handle left its range"),
            Self::MissedTicks { ticks } => write!(f, "{ticks} ticks were missed"),
            Self::TimeOfDaySet { by_ms } => {
                let (way, s) = (if *by_ms < 0 { "back" } else { "forward" }, by_ms.unsigned_abs() / 1000);
                write!(f, "the time of day was set {way} by {s} s; times of the sitting go on without a jump")
            }
            Self::Killed => {
                f.write_str("broke off without a line: the process was killed, or the power failed")
            }
            Self::NotRecorded { reason } => write!(f, "the movement was not recorded: {reason}"),
        }
    }
}
