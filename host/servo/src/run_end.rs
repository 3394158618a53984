//! End of a run: its word in summaries, its text, and the exit code of a command.

use crate::{Cause, EmergencySource, Heartbeat, PaceLost, RunState, Stuck};
use flotor_hal::Fault;

/// End of a run: a row of the table in docs/src/command-line.md.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// The duration is over.
    Finished,
    /// A stop was requested.
    Stopped,
    /// The device faulted.
    DeviceFault(Fault),
    /// The emergency stop was pressed.
    EmergencyStop(EmergencySource),
    /// The device sets a faster pace than the scene declares: this many samples per second.
    TooFast(u32),
    /// The scene requires the device to set the pace, but the device sets none with its settings.
    NotPaced,
    /// A tick took so long that the watchdog stopped the device, and returned later; or the gap between two ticks was too long, as
    /// for a suspended process.
    Watchdog(Stuck),
    /// The force of a device oscillated between its limits, even after damping.
    Oscillation,
    /// The required watchdog process exited; the run was stopped in order.
    Unguarded,
}

impl RunEnd {
    /// Returns true if the run finished, or stopped on request. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn is_in_order(self) -> bool {
        matches!(self, Self::Finished | Self::Stopped)
    }

    /// Returns the word for the end in summaries, on which scripts rely, and the exit code of a command.
    const fn row(self) -> (&'static str, u8) {
        match self {
            Self::Finished => ("finished", 0),
            Self::Stopped => ("stopped", 0),
            Self::DeviceFault(_) => ("device_fault", 4),
            Self::EmergencyStop(_) => ("emergency_stop", 4),
            Self::TooFast(_) => ("too_fast", 4),
            Self::NotPaced => ("not_paced", 2),
            Self::Watchdog(_) => ("watchdog", 4),
            Self::Oscillation => ("oscillation", 4),
            Self::Unguarded => ("unguarded", 1),
        }
    }

    /// Returns the word for the end in summaries.
    #[must_use]
    pub const fn word(self) -> &'static str {
        self.row().0
    }

    /// Returns the exit code of a command after the run, if no model failed.
    #[must_use]
    pub const fn exit_code(self) -> u8 {
        self.row().1
    }

    /// Returns the cause of the end, as text for users.
    #[must_use]
    pub fn cause(self) -> String {
        match self {
            Self::DeviceFault(fault) => format!("device fault, {}", fault.advice()),
            Self::EmergencyStop(source) => format!("emergency stop ({})", source.word()),
            Self::TooFast(samples_per_s) => {
                format!(
                    "the device sends {samples_per_s} samples a second, more than the loop rate; raise `rate_hz` \
                     to at least {samples_per_s}, or set `pacing = \"host\"`"
                )
            }
            Self::NotPaced => {
                "the device does not set the pace with its present settings; remove `pacing = \"device\"`"
                    .to_owned()
            }
            Self::Oscillation => "the force oscillated between its limits".to_owned(),
            Self::Watchdog(_) => "a tick took longer than the watchdog allows".to_owned(),
            Self::Unguarded => "the watchdog process had ended, and the scene requires it".to_owned(),
            Self::Finished | Self::Stopped => "the run was stopped".to_owned(),
        }
    }

    /// Converts a lost pace to a `RunEnd`.
    pub(crate) fn without_pace(lost: PaceLost) -> Self {
        match lost {
            PaceLost::NotPaced => Self::NotPaced,
            PaceLost::TooFast { samples, elapsed_ns } => {
                let per_s = samples.saturating_mul(1_000_000_000) / elapsed_ns.max(1);
                Self::TooFast(u32::try_from(per_s).unwrap_or(u32::MAX))
            }
        }
    }

    /// Converts the final run state to a `RunEnd`.
    pub(crate) fn of(run: RunState, heartbeat: &Heartbeat) -> Self {
        match (run, heartbeat.fired_at()) {
            (RunState::Faulted(Cause::Device(fault)), _) => Self::DeviceFault(fault),
            // The watchdog has not fired if the whole process was suspended.
            (RunState::Faulted(Cause::Watchdog), stuck) => Self::Watchdog(stuck.unwrap_or(heartbeat.now())),
            (RunState::Faulted(Cause::Oscillation), _) => Self::Oscillation,
            (RunState::EmergencyStopped(source), _) => Self::EmergencyStop(source),
            _ => Self::Stopped,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Place;

    #[test]
    fn the_table_of_the_book_has_the_word_and_the_exit_code_of_each_end() {
        let ends = [
            RunEnd::Finished,
            RunEnd::Stopped,
            RunEnd::DeviceFault(Fault::Disconnected),
            RunEnd::EmergencyStop(EmergencySource::Key),
            RunEnd::Watchdog(Stuck { tick: 0, place: Place::Waiting }),
            RunEnd::Oscillation,
            RunEnd::TooFast(0),
            RunEnd::NotPaced,
            RunEnd::Unguarded,
        ];
        let book = include_str!("../../../docs/src/command-line.md");
        let (_, table) = book.split_once("| `end` | | Exit code |\n|---|---|---|\n").expect("the table");
        let rows = table.lines().take_while(|line| line.starts_with('|'));
        let cells =
            |row: &str| -> Vec<String> { row.split('|').map(|cell| cell.trim().to_owned()).collect() };
        let listed: Vec<_> = rows.map(cells).map(|cells| (cells[1].clone(), cells[3].clone())).collect();
        let expected = ends.map(|end| (format!("`{}`", end.word()), end.exit_code().to_string()));
        assert_eq!(listed, expected);
    }
}
