//! Emergency-stop latch during a run: nothing is energised while the latch is pressed, a press ends the run, and an emergency stop
//! of the run presses the latch.

use super::error::RunError;
use flotor_core::lock;
use flotor_live::{Directory, Latch, LatchState, process_number};
use flotor_servo::{EmergencySource, StopSwitch, enter_guard_priority};
use std::fmt::{self, Display, Formatter};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Purpose of the latch's thread, for the error if the thread cannot be started.
pub(super) const WATCH: &str = "the emergency stop of the machine";
/// Poll interval of the latch file, for the stops of other runs. The emergency stop of this run wakes the thread at once.
const POLL: Duration = Duration::from_millis(5);
/// Timeout for the confirmation of an emergency stop by the other runs.
const CONFIRM_WAIT: Duration = Duration::from_secs(2);

/// Emergency-stop latch, with its state when the preparation of a run began.
#[derive(Clone, Debug)]
pub struct LatchGuard {
    latch: Latch,
    /// State at the start of the preparation. A second press of a pressed latch is lost at the release, so a latch that was pressed
    /// at the start counts as pressed.
    at_start: LatchState,
    /// Effect of this run's emergency stop on other runs; `None` before the stop.
    reach: Arc<Mutex<Option<StopReach>>>,
}

/// Effect of an emergency stop on the other runs of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopReach {
    /// Reason why a later run may start, if the latch could not be pressed.
    unkept: Option<String>,
    /// Processes whose runs have not confirmed the stop, or the reason why the runs are unknown.
    unconfirmed: Result<Vec<u32>, String>,
}

impl LatchGuard {
    /// Creates a guard of the latch in `directory`. Every press from now on counts, even if the latch is released before the next
    /// check. Not real-time.
    #[must_use]
    pub fn of(directory: &Directory) -> Self {
        let latch = directory.latch();
        let at_start = latch.state();
        Self { latch, at_start, reach: Arc::default() }
    }

    /// Creates a guard of the latch in the run folder of this user. Not real-time.
    #[must_use]
    pub fn of_this_user() -> Self {
        Self::of(&Directory::of_this_user())
    }

    /// Returns a warning if an emergency stop of this run will not be stored or may not reach other runs; `None` otherwise. Call
    /// this function before anything is energised. Not real-time.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let problem = self.latch.problem()?;
        Some(format!("an emergency stop of this run is not stored and may not reach other runs: {problem}"))
    }

    /// Checks the latch right before a device is energised, after [`LatchGuard::watch`]. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`] if the latch is pressed, or was pressed since the guard was created.
    pub fn check(&self) -> Result<(), RunError> {
        let now = self.latch.state();
        let was_pressed = self.at_start.pressed.is_some() || now.was_pressed_after(&self.at_start);
        match now.pressed {
            Some(pressed) => Err(RunError::Latched(Some(pressed))),
            None if was_pressed => Err(RunError::Latched(None)),
            None => Ok(()),
        }
    }

    /// Watches the latch in a separate thread until the returned watch is dropped: a press of the latch triggers the emergency stop
    /// of `stop`, and any other emergency stop of this run presses the latch. Not real-time.
    ///
    /// # Errors
    /// If the system cannot start a thread.
    pub fn watch(&self, stop: &StopSwitch) -> io::Result<LatchWatch> {
        self.watch_with(POLL, stop)
    }

    fn watch_with(&self, poll: Duration, stop: &StopSwitch) -> io::Result<LatchWatch> {
        let is_over = Arc::<AtomicBool>::default();
        let (guard, stop, until) = (self.clone(), stop.clone(), Arc::clone(&is_over));
        let thread = std::thread::Builder::new().name("flotor-latch".to_owned());
        let thread = thread.spawn(move || guard.attend(poll, &stop, &until))?;
        Ok(LatchWatch { is_over, thread: Some(thread) })
    }

    /// Presses the latch for an emergency stop of this process, and requests all other runs to stop. Later calls only return the
    /// result of the first. Not real-time: waits for the other runs, 2 s at most.
    pub fn press(&self, source: EmergencySource) -> StopReach {
        let mut reach = lock(&self.reach);
        let reach = reach.get_or_insert_with(|| {
            let who = format!("emergency stop ({}) of process {}", source.word(), process_number());
            let pressed = self.latch.press(&who);
            let requested = self.latch.stop_runs(Instant::now() + CONFIRM_WAIT);
            StopReach {
                unkept: pressed.err().map(|error| error.to_string()),
                unconfirmed: requested.map_err(|error| error.to_string()),
            }
        });
        reach.clone()
    }

    /// Returns the effect of this run's emergency stop on other runs; `None` before the stop, and for a stop by another run. Not
    /// real-time.
    #[must_use]
    pub fn reach(&self) -> Option<StopReach> {
        lock(&self.reach).clone()
    }

    /// Returns the time of the press, if the latch is pressed. Not real-time.
    pub(super) fn pressed_at(&self) -> Option<SystemTime> {
        self.latch.state().pressed.map(|pressed| pressed.at)
    }

    /// Starts to watch the latch, as [`Self::watch`] does, and checks the latch, as [`Self::check`] does: for devices that are
    /// energised without [`Session::run`](super::Session::run). Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`] as for [`Self::check`]; [`RunError::NoThread`] if the system cannot start a thread.
    pub fn check_and_watch(&self, stop: &StopSwitch) -> Result<LatchWatch, RunError> {
        let watch = self.watch(stop).map_err(|_| RunError::NoThread(WATCH))?;
        self.check().map(|()| watch)
    }

    fn attend(&self, poll: Duration, stop: &StopSwitch, is_over: &AtomicBool) {
        // The emergency stop of another run waits for this thread.
        enter_guard_priority();
        loop {
            let is_last = is_over.load(Ordering::Relaxed);
            match stop.emergency() {
                None if self.check().is_err() => stop.press(EmergencySource::Latch),
                None => {}
                Some(EmergencySource::Latch) => return,
                Some(source) => {
                    self.press(source);
                    return;
                }
            }
            if is_last {
                return;
            }
            stop.sleep_until_pressed(poll);
        }
    }
}

impl StopReach {
    /// Returns a message with the runs that have not confirmed the stop and the reason why later runs may start; `None` if all runs
    /// are stopped and no later run can start.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let mut problems = Vec::new();
        match &self.unconfirmed {
            Ok(processes) if processes.is_empty() => {}
            Ok(processes) => {
                let processes: Vec<String> = processes.iter().map(u32::to_string).collect();
                let processes = processes.join(", ");
                problems.push(format!("not confirmed by process {processes}: switch the devices off"));
            }
            Err(cause) => problems.push(format!(
                "the state of the other runs is unknown: {cause}; check that each has stopped"
            )),
        }
        let unkept = |cause| format!("the emergency stop does not prevent a later run: {cause}");
        problems.extend(self.unkept.as_ref().map(unkept));
        (!problems.is_empty()).then(|| problems.join("; "))
    }
}

impl Display for StopReach {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Some(problem) = self.problem() else {
            return formatter
                .write_str("all runs of this machine are stopped, and none starts until `flotor release`");
        };
        let extent = match &self.unconfirmed {
            Ok(processes) if processes.is_empty() => "all runs found on this machine are stopped, but",
            Ok(_) => "some runs of this machine may not be stopped:",
            Err(_) => "the emergency stop is confirmed for this run only:",
        };
        write!(formatter, "{extent} {problem}")
    }
}

/// Handle of the thread that watches a latch; dropping the handle stops and joins the thread.
#[derive(Debug)]
pub struct LatchWatch {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for LatchWatch {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two presses are one line: a run that began between them, and looked only after the release, went on behind the second "done".
    #[test]
    fn a_run_that_began_while_it_was_pressed_stays_refused_after_the_release() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        directory.latch().press("first").unwrap();
        let run = LatchGuard::of(&directory);
        directory.latch().press("second").unwrap();
        directory.latch().release("owner").unwrap();
        assert!(matches!(run.check(), Err(RunError::Latched(None))));
        assert!(LatchGuard::of(&directory).check().is_ok(), "the next one runs");
    }

    #[test]
    fn an_emergency_stop_right_before_the_end_presses() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let stop = StopSwitch::default();
        let watch = LatchGuard::of(&directory).check_and_watch(&stop).unwrap();
        stop.press(EmergencySource::Key);
        drop(watch);
        assert!(directory.latch().state().pressed.is_some());
    }

    /// The poll interval of this run was in series with that of the other one.
    #[test]
    fn an_emergency_stop_reaches_the_latch_and_the_other_runs_without_a_poll() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let silent = directory.listen().unwrap();
        let (stop, guard) = (StopSwitch::default(), LatchGuard::of(&directory));
        let watch = guard.watch_with(Duration::from_secs(60), &stop).unwrap();
        std::thread::sleep(Duration::from_millis(100)); // the thread has polled once, and sleeps
        stop.press(EmergencySource::Key);
        let before_the_second_poll = Instant::now() + Duration::from_secs(30);
        while guard.reach().is_none() {
            assert!(Instant::now() < before_the_second_poll, "the press wakes nobody");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(directory.latch().state().pressed.is_some());
        assert!(
            guard.reach().unwrap().to_string().contains("not confirmed by process"),
            "the other was asked"
        );
        drop((watch, silent));
    }

    #[test]
    fn a_stop_that_reaches_no_other_run_says_so_before_and_after() {
        let scratch = tempfile::tempdir().unwrap();
        let file = scratch.path().join("file");
        std::fs::write(&file, "").unwrap();
        let apart = LatchGuard::of(&Directory::at(file.join("runs")));
        assert!(apart.warning().unwrap().contains("is not stored"));
        assert!(apart.press(EmergencySource::Key).to_string().contains("does not prevent a later run"));
        let usual = LatchGuard::of(&Directory::at(scratch.path().join("runs")));
        assert_eq!(usual.warning(), None);
        assert_eq!(usual.reach(), None);
        let silent = Directory::at(scratch.path().join("runs")).listen().unwrap();
        assert!(usual.press(EmergencySource::Key).to_string().contains("not confirmed by process"));
        assert_eq!(usual.reach(), Some(usual.press(EmergencySource::Key)));
        drop(silent);
    }

    /// A stop that every run had confirmed was "confirmed for this run only" if the latch could not be written.
    #[test]
    fn the_note_distinguishes_an_unwritten_latch_from_unconfirmed_and_unknown_runs() {
        let text = |unkept: Option<&str>, unconfirmed| {
            StopReach { unkept: unkept.map(str::to_owned), unconfirmed }.to_string()
        };
        let unwritten = Some("it is read-only");
        for (text, start) in [
            (
                text(unwritten, Ok(Vec::new())),
                "all runs found on this machine are stopped, but the emergency",
            ),
            (
                text(unwritten, Ok(vec![7, 8])),
                "some runs of this machine may not be stopped: not confirmed by",
            ),
            (
                text(None, Ok(vec![7])),
                "some runs of this machine may not be stopped: not confirmed by process 7",
            ),
            (
                text(None, Err("denied".to_owned())),
                "the emergency stop is confirmed for this run only: the state",
            ),
        ] {
            assert!(text.starts_with(start), "{text}");
        }
    }
}
