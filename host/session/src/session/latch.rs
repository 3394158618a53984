//! A run and the latch of its machine: nothing is energised while it is pressed, a press ends the run, and an emergency stop of the
//! run presses it.

use super::RunError;
use flotor_live::{Directory, Latch, LatchState, Pressed};
use flotor_servo::{EmergencySource, StopSwitch};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Why there is no run without a thread that watches.
pub(super) const NO_WATCH: &str = "got no watch over the emergency stop of the machine";
/// Pause between two looks at the latch.
const LOOK_PERIOD: Duration = Duration::from_millis(5);

/// The latch as it was when a run began to load.
#[derive(Clone, Debug)]
pub struct LatchGuard {
    latch: Latch,
    presses: u64,
    /// Whether it was pressed then. A second press adds no line to the file: who pressed while the run began would not be seen
    /// behind a release.
    was_pressed: bool,
}

impl LatchGuard {
    /// From now on every press counts, also one that is released before anybody looks. Not real-time.
    #[must_use]
    pub fn of(directory: &Directory) -> Self {
        let latch = directory.latch();
        let LatchState { presses, pressed } = latch.state();
        Self { latch, presses, was_pressed: pressed.is_some() }
    }

    /// Of the folder in which runs of this user are found. Not real-time.
    #[must_use]
    pub fn of_this_user() -> Self {
        Self::of(&Directory::of_this_user())
    }

    /// The latch.
    #[must_use]
    pub fn latch(&self) -> &Latch {
        &self.latch
    }

    /// To be called right before a device is energised, after [`LatchGuard::watch`]. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`].
    pub fn check(&self) -> Result<(), RunError> {
        match self.latch.state() {
            LatchState { pressed: Some(pressed), .. } => Err(RunError::Latched(Some(pressed))),
            LatchState { presses, .. } if self.was_pressed || presses > self.presses => {
                Err(RunError::Latched(None))
            }
            _ => Ok(()),
        }
    }

    /// Watches on a thread of its own until the watch is dropped: a press closes the switch, and the switch's own emergency stop
    /// presses. Not real-time.
    ///
    /// # Errors
    /// No thread.
    pub fn watch(&self, stop: &StopSwitch) -> io::Result<LatchWatch> {
        let is_over = Arc::<AtomicBool>::default();
        let (guard, stop, until) = (self.clone(), stop.clone(), Arc::clone(&is_over));
        let thread = std::thread::Builder::new().name("flotor-latch".to_owned());
        let thread = thread.spawn(move || guard.attend(&stop, &until))?;
        Ok(LatchWatch { is_over, thread: Some(thread) })
    }

    /// Presses for an emergency stop of this process, unless the latch was its cause. Not real-time.
    pub fn press(&self, source: EmergencySource) -> Option<String> {
        if source == EmergencySource::Latch {
            return None;
        }
        let who = format!("emergency stop ({}) of process {}", source.word(), std::process::id());
        self.latch.press(&who).err().map(|error| error.to_string())
    }

    /// Checks once, and watches until the watch is dropped: for what moves a device without [`Session::run`](super::Session::run).
    /// Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`], or no thread.
    pub fn obey(&self, stop: &StopSwitch) -> Result<LatchWatch, RunError> {
        let watch = self.watch(stop).map_err(|_| RunError::Thread(NO_WATCH))?;
        self.check().map(|()| watch)
    }

    fn attend(&self, stop: &StopSwitch, is_over: &AtomicBool) {
        let (mut length, mut has_pressed) = (None, false);
        loop {
            let is_last = is_over.load(Ordering::Relaxed);
            match stop.emergency() {
                None => {
                    let now = self.latch.length();
                    if now != length {
                        length = now;
                        if self.check().is_err() {
                            stop.press(EmergencySource::Latch);
                        }
                    }
                }
                // A folder that cannot be used is reported when the run is over.
                Some(source) if !has_pressed => has_pressed = self.press(source).is_none(),
                Some(_) => {}
            }
            if is_last {
                return;
            }
            std::thread::sleep(LOOK_PERIOD);
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
}
