//! Schedule for the end of `flotor lend` after a request to stop. Program and service share one schedule, which starts with the
//! request, so that their grace periods do not add up.

use flotor_command::CommandError;
use flotor_command::stopping::stop_on_signals;
use flotor_servo::StopSwitch;
use std::cell::OnceCell;
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

/// Poll interval for the request and for the end of the processes.
const POLL: Duration = Duration::from_millis(10);

/// Stage of the schedule, in order of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    /// No stop was requested.
    Running,
    /// A stop was requested: the program may end by the signal that a terminal has sent to it.
    Requested,
    /// The program has received SIGTERM.
    ProgramAsked,
    /// The process group of the program is killed.
    ProgramKilled,
    /// The service is killed, and all waiting ends.
    Over,
}

impl Stage {
    /// Stages after a request, each with the time from the request to its start.
    const SCHEDULE: [(Self, Duration); 4] = [
        (Self::Requested, Duration::ZERO),
        (Self::ProgramAsked, Duration::from_millis(300)),
        (Self::ProgramKilled, Duration::from_millis(1000)),
        (Self::Over, Duration::from_millis(1800)),
    ];

    /// Returns the stage at this time after the request.
    fn after(since_request: Duration) -> Self {
        let begun = Self::SCHEDULE.iter().rev().find(|(_, start)| since_request >= *start);
        begun.map_or(Self::Requested, |(stage, _)| *stage)
    }
}

/// Reason why `flotor lend` ends without a result of its program.
pub(crate) enum Early {
    Failed(CommandError),
    /// Exit code, after a request to stop or an error that another process has printed.
    Exit(i32),
}

impl From<CommandError> for Early {
    fn from(error: CommandError) -> Self {
        Self::Failed(error)
    }
}

/// Request to stop `flotor lend`, by a signal.
pub(crate) struct StopRequest {
    switch: StopSwitch,
    /// Time of the poll that found the request.
    found: OnceCell<Instant>,
}

impl StopRequest {
    /// Installs the handlers of the signals that request the stop; must be called before other threads start.
    pub(crate) fn by_signals() -> Result<Self, CommandError> {
        Ok(Self { switch: stop_on_signals()?, found: OnceCell::new() })
    }

    /// Returns the current stage; after an emergency stop at least [`Stage::ProgramKilled`].
    pub(crate) fn stage(&self) -> Stage {
        self.stage_at(Instant::now())
    }

    fn stage_at(&self, now: Instant) -> Stage {
        let is_emergency = self.switch.emergency().is_some();
        if !is_emergency && !self.switch.is_stop_requested() {
            return Stage::Running;
        }
        let stage = Stage::after(now.saturating_duration_since(*self.found.get_or_init(|| now)));
        if is_emergency { stage.max(Stage::ProgramKilled) } else { stage }
    }

    /// Calls `poll` with the current stage until `poll` returns a value, and returns this value; `None` after the poll at
    /// [`Stage::Over`].
    pub(crate) fn poll<T>(&self, mut poll: impl FnMut(Stage) -> Option<T>) -> Option<T> {
        loop {
            let stage = self.stage();
            if let Some(value) = poll(stage) {
                return Some(value);
            }
            if stage == Stage::Over {
                return None;
            }
            std::thread::sleep(POLL);
        }
    }
}

/// Returns the exit status of a process that has ended; `None` while the process runs.
pub(crate) fn has_ended(child: &mut Child) -> Option<ExitStatus> {
    child.try_wait().unwrap_or_else(|_| Some(ExitStatus::default()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_servo::EmergencySource;

    /// Time in which `flotor lend` ends, by docs/src/command-line.md.
    const LIMIT: Duration = Duration::from_secs(2);

    fn request() -> StopRequest {
        StopRequest { switch: StopSwitch::default(), found: OnceCell::new() }
    }

    #[test]
    fn all_grace_periods_together_end_within_the_limit() {
        assert!(
            Stage::SCHEDULE.is_sorted_by(|(before, start), (after, later)| before < after && start < later)
        );
        let (last, start) = Stage::SCHEDULE[Stage::SCHEDULE.len() - 1];
        assert_eq!(last, Stage::Over);
        // Ten polls for the exit.
        assert!(start + 10 * POLL < LIMIT);
    }

    #[test]
    fn the_schedule_starts_once_whichever_phase_polls() {
        let (request, start) = (request(), Instant::now());
        let at = |ms| request.stage_at(start + Duration::from_millis(ms));
        assert_eq!(at(0), Stage::Running);
        request.switch.stop();
        // The service is waited for, then the program, then the service again.
        let stages = [5000, 5299, 5300, 5999, 6000, 6799, 6800, 60_000].map(at);
        let [requested, asked, killed] = [Stage::Requested, Stage::ProgramAsked, Stage::ProgramKilled];
        assert_eq!(stages, [requested, requested, asked, asked, killed, killed, Stage::Over, Stage::Over]);
        request.switch.stop();
        assert_eq!(at(60_000), Stage::Over, "a second request gives no more time");
    }

    #[test]
    fn an_emergency_stop_kills_the_program_at_once() {
        let (request, start) = (request(), Instant::now());
        request.switch.press(EmergencySource::Signal);
        assert_eq!(request.stage_at(start), Stage::ProgramKilled);
        assert_eq!(request.stage_at(start + Duration::from_millis(1799)), Stage::ProgramKilled);
        assert_eq!(request.stage_at(start + Duration::from_millis(1800)), Stage::Over);
    }

    #[test]
    fn a_poll_without_a_value_ends_with_the_schedule() {
        let request = request();
        let long_ago = Instant::now().checked_sub(LIMIT).expect("the machine has been on for longer");
        let _ = request.found.set(long_ago);
        request.switch.stop();
        assert_eq!(request.poll(|_| None::<()>), None);
        assert_eq!(request.poll(Some), Some(Stage::Over), "one poll, however late");
    }
}
