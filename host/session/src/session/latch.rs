//! A run and the latch of its machine: nothing is energised while it is pressed, a press ends the run, and an emergency stop of the
//! run presses it.

use super::RunError;
use flotor_live::{Directory, Latch, LatchState, Pressed, process_number};
use flotor_servo::{EmergencySource, StopSwitch, enter_guard_priority};
use std::fmt::{self, Display, Formatter};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Purpose of the thread without which nothing is energised.
pub(super) const WATCH: &str = "the emergency stop of the machine";
/// Poll interval of the latch file, for the stops of other runs. The emergency stop of this run wakes the thread at once.
const POLL: Duration = Duration::from_millis(5);
/// Time in which the other runs confirm an emergency stop.
const CONFIRM_WAIT: Duration = Duration::from_secs(2);

/// The latch as it was when a run began to load.
#[derive(Clone, Debug)]
pub struct LatchGuard {
    latch: Latch,
    /// A second press changes nothing while the first is not released: who pressed while the run began would not be seen behind a
    /// release.
    at_start: LatchState,
    /// What the emergency stop of this run has reached, once it was pressed.
    reach: Arc<Mutex<Option<StopReach>>>,
}

/// What an emergency stop of this run has reached beyond it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopReach {
    /// Why a later run may start, if so.
    unkept: Option<String>,
    /// The processes of the runs that have not confirmed it, or why the runs are not known.
    unconfirmed: Result<Vec<u32>, String>,
}

impl LatchGuard {
    /// From now on every press counts, also one that is released before anybody looks. Not real-time.
    #[must_use]
    pub fn of(directory: &Directory) -> Self {
        let latch = directory.latch();
        let at_start = latch.state();
        Self { latch, at_start, reach: Arc::default() }
    }

    /// Of the folder in which runs of this user are found. Not real-time.
    #[must_use]
    pub fn of_this_user() -> Self {
        Self::of(&Directory::of_this_user())
    }

    /// What an emergency stop of this run will not reach, if so: for people, before anything is energised.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let problem = self.latch.problem()?;
        Some(format!("an emergency stop does not outlast this run and may reach no other run: {problem}"))
    }

    /// To be called right before a device is energised, after [`LatchGuard::watch`]. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`].
    pub fn check(&self) -> Result<(), RunError> {
        let now = self.latch.state();
        let was_pressed = self.at_start.pressed.is_some() || now.was_pressed_after(&self.at_start);
        match now.pressed {
            Some(pressed) => Err(RunError::Latched(Some(pressed))),
            None if was_pressed => Err(RunError::Latched(None)),
            None => Ok(()),
        }
    }

    /// Watches on a thread of its own until the watch is dropped: a press closes the switch, and the switch's own emergency stop
    /// presses. Not real-time.
    ///
    /// # Errors
    /// No thread.
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

    /// Presses for an emergency stop of this process, and asks the other runs to stop. Once only: whoever calls again gets what
    /// the first call has reached. Not real-time: waits for the other runs, 2 s at most.
    pub fn press(&self, source: EmergencySource) -> StopReach {
        let mut reach = self.reach.lock().unwrap_or_else(PoisonError::into_inner);
        let reach = reach.get_or_insert_with(|| {
            let who = format!("emergency stop ({}) of process {}", source.word(), process_number());
            let pressed = self.latch.press(&who);
            let asked = self.latch.stop_runs(Instant::now() + CONFIRM_WAIT);
            StopReach {
                unkept: pressed.err().map(|error| error.to_string()),
                unconfirmed: asked.map_err(|error| error.to_string()),
            }
        });
        reach.clone()
    }

    /// What the emergency stop of this run has reached; nothing before, and if it came from another run. Not real-time.
    #[must_use]
    pub fn reach(&self) -> Option<StopReach> {
        self.reach.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the time of the press that is not released. Not real-time.
    pub(super) fn pressed_at(&self) -> Option<SystemTime> {
        self.latch.state().pressed.map(|pressed| pressed.at)
    }

    /// Checks once, and watches until the watch is dropped: for what moves a device without [`Session::run`](super::Session::run).
    /// Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`], or no thread.
    pub fn obey(&self, stop: &StopSwitch) -> Result<LatchWatch, RunError> {
        let watch = self.watch(stop).map_err(|_| RunError::NoThread(WATCH))?;
        self.check().map(|()| watch)
    }

    fn attend(&self, poll: Duration, stop: &StopSwitch, is_over: &AtomicBool) {
        // A stop of another run waits for this thread.
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
    /// Why the stop has not reached every run, now and later; nothing if it has.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let unconfirmed = match &self.unconfirmed {
            Ok(processes) if processes.is_empty() => None,
            Ok(processes) => {
                let processes: Vec<String> = processes.iter().map(u32::to_string).collect();
                Some(format!("not confirmed by process {}: switch its device off", processes.join(", ")))
            }
            Err(cause) => {
                Some(format!("the other runs cannot be asked: {cause}; check that each has stopped"))
            }
        };
        let unkept = self.unkept.as_ref().map(|cause| format!("a later run is not refused: {cause}"));
        let problems: Vec<String> = unconfirmed.into_iter().chain(unkept).collect();
        (!problems.is_empty()).then(|| problems.join("; "))
    }
}

impl Display for StopReach {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self.problem() {
            None => formatter
                .write_str("all runs of this machine are stopped, and none starts until `flotor release`"),
            Some(problem) => write!(formatter, "the emergency stop is certain for this run only: {problem}"),
        }
    }
}

/// The thread that watches a latch; it ends when dropped.
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

/// Why nothing may be energised, in words.
pub(super) fn latched_words(pressed: Option<&Pressed>) -> String {
    match pressed {
        Some(pressed) => format!(
            "the emergency stop of this machine is pressed ({pressed}): nothing is energised; `flotor release` releases it"
        ),
        None => {
            "the emergency stop of this machine was pressed while the run started: start it again".to_owned()
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
        let watch = LatchGuard::of(&directory).obey(&stop).unwrap();
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
        assert!(apart.warning().unwrap().contains("does not outlast this run"));
        assert!(apart.press(EmergencySource::Key).to_string().contains("a later run is not refused"));
        let usual = LatchGuard::of(&Directory::at(scratch.path().join("runs")));
        assert_eq!(usual.warning(), None);
        assert_eq!(usual.reach(), None);
        let silent = Directory::at(scratch.path().join("runs")).listen().unwrap();
        assert!(usual.press(EmergencySource::Key).to_string().contains("not confirmed by process"));
        assert_eq!(usual.reach(), Some(usual.press(EmergencySource::Key)));
        drop(silent);
    }
}
