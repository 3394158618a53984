//! Front ends of a person's sitting: text on a terminal, the viewer's window, or lines of JSON for another window.

mod designed_terminal;
mod json;
mod terminal;
mod window;

pub(super) use json::JsonLines;
pub(super) use terminal::Terminal;
pub(super) use window::Window;

use clap::ValueEnum;
use flotor_command::CommandError;
use flotor_servo::THREAD_ADVICE;
use flotor_study::apparatus::attend::PollResult;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Timeout of one poll for input; between polls the handle is checked.
const MOMENT: Duration = Duration::from_millis(50);

/// Values of `--screen`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ScreenOption {
    /// The viewer's window, in front of the person
    #[default]
    Viewer,
    /// Text on this terminal, answers by keyboard
    Terminal,
    /// One screen per line of JSON on standard output, one input per line on standard input
    Json,
}

/// Waits up to [`MOMENT`] for a line of input, and reads the line with `read`. Without a line the result is
/// [`PollResult::Nothing`], or [`PollResult::Closed`] at the end of the input.
fn next_input<I>(
    lines: &Receiver<String>,
    read: impl FnOnce(&str) -> Result<PollResult<I>, String>,
) -> Result<PollResult<I>, String> {
    match lines.recv_timeout(MOMENT) {
        Ok(line) => read(&line),
        Err(RecvTimeoutError::Timeout) => Ok(PollResult::Nothing),
        // The input has ended: the window, or standard input, is closed.
        Err(RecvTimeoutError::Disconnected) => Ok(PollResult::Closed),
    }
}

/// Starts a background thread that reads lines, and returns the channel of the lines.
pub(super) fn lines_of(reader: impl BufRead + Send + 'static) -> Result<Receiver<String>, CommandError> {
    let (sender, lines) = channel();
    // The thread is detached, because a blocking read cannot be interrupted; it ends with the input, the receiver or the
    // process.
    let thread = std::thread::Builder::new().name("flotor-answers".to_owned()).spawn(move || {
        for line in reader.lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    thread.map(|_| lines).map_err(|cause| {
        CommandError::Failed(format!(
            "cannot start the thread that reads the input: {cause}; {THREAD_ADVICE}"
        ))
    })
}
