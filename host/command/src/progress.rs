//! How far a command has come, on a terminal.

use crate::style::for_terminal;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress line on a terminal, nothing in a pipe.
#[must_use]
pub fn progress_bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Runs what may take long before the first tick, with the time that it has taken on a terminal: `{what}: prepares`.
pub fn while_preparing<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let spinner = progress_bar(0, "{spinner} {msg} {elapsed}");
    spinner.set_message(format!("{}: prepares", for_terminal(what)));
    spinner.enable_steady_tick(SPINNER_STEP);
    let result = work();
    spinner.finish_and_clear();
    result
}

/// Between two pictures of the spinner; short preparations show none.
const SPINNER_STEP: std::time::Duration = std::time::Duration::from_millis(300);
