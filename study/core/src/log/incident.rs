//! Interruptions and disturbances of a sitting, in the detail that ethics boards require to be logged.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Interruption or disturbance of a sitting.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "incident", rename_all = "kebab-case")]
pub enum Incident {
    /// The emergency stop was pressed.
    EmergencyStop {
        /// Source: key, signal, window, device.
        source: String,
    },
    /// The run ended by itself or failed.
    RunEnded {
        /// Error or reason of the end.
        reason: String,
    },
    /// The window in front of the person, or standard input, was closed.
    WindowClosed,
    /// The stop key was pressed.
    Stopped,
    /// A signal or a client requested the end of the program.
    Signal,
    /// The handle was pushed out of its range.
    OutOfRange,
    /// The servo missed ticks.
    MissedTicks {
        /// Number of missed ticks.
        ticks: u64,
    },
    /// The system's time of day was set; the times of the sitting are unaffected.
    TimeOfDaySet {
        /// Change of the time of day, ms; positive forward, negative back.
        by_ms: i64,
    },
    /// The sitting ended without a log entry: the process was killed or the power failed. Logged on resumption.
    Killed,
    /// The recording of a trial failed; the sitting continued.
    NotRecorded {
        /// Error of the recording.
        reason: String,
    },
}

impl Incident {
    /// Returns true for an interruption: the sitting ends until it is resumed.
    pub(crate) fn ends_the_sitting(&self) -> bool {
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
            Self::WindowClosed => f.write_str("the window or standard input was closed"),
            Self::Stopped => f.write_str("stopped at the keyboard"),
            Self::Signal => f.write_str("ended by a signal or a client"),
            Self::OutOfRange => f.write_str("the handle left its range"),
            Self::MissedTicks { ticks } => write!(f, "{ticks} ticks were missed"),
            Self::TimeOfDaySet { by_ms } => {
                let (way, s) = (if *by_ms < 0 { "back" } else { "forward" }, by_ms.unsigned_abs() / 1000);
                write!(
                    f,
                    "the time of day was set {way} by {s} s; the times of the sitting continue without a jump"
                )
            }
            Self::Killed => {
                f.write_str("ended without a line in the log: the process was killed, or the power failed")
            }
            Self::NotRecorded { reason } => write!(f, "the movement was not recorded: {reason}"),
        }
    }
}
