//! Progress of a command, on a terminal.

use crate::style::for_terminal;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::convert::Infallible;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Creates a progress line on standard error, with a template of `indicatif`; hidden if standard error is not a terminal.
#[must_use]
pub fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Runs `work` and returns its result; meanwhile shows `{what}: prepares` with the elapsed time on a terminal.
pub fn while_preparing<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let spinner = progress_bar(0, "{spinner} {msg} {elapsed}");
    spinner.set_message(format!("{}: prepares", for_terminal(what)));
    let redrawn = Redrawn::every(SPINNER_STEP, &spinner);
    let result = work();
    drop(redrawn);
    spinner.finish_and_clear();
    result
}

/// Thread that redraws a progress line; dropping it ends the thread.
pub struct Redrawn {
    until: Option<Sender<Infallible>>,
    thread: Option<JoinHandle<()>>,
}

impl Redrawn {
    /// Starts a thread that redraws `line` every `step`; without a terminal, or if the system cannot start a thread, nothing is redrawn.
    #[must_use]
    pub fn every(step: Duration, line: &ProgressBar) -> Self {
        if line.is_hidden() {
            return Self { until: None, thread: None };
        }
        let (until, ended) = channel::<Infallible>();
        let line = line.clone();
        let redraw = move || {
            while ended.recv_timeout(step) == Err(RecvTimeoutError::Timeout) && !line.is_finished() {
                line.tick();
            }
        };
        let thread = std::thread::Builder::new().name("flotor-progress".to_owned()).spawn(redraw);
        Self { until: Some(until), thread: thread.ok() }
    }
}

impl Drop for Redrawn {
    fn drop(&mut self) {
        drop(self.until.take());
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Interval between two frames of the spinner.
const SPINNER_STEP: Duration = Duration::from_millis(300);
