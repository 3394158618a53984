//! Front ends of a person's sitting: text on a terminal, the viewer's window, or lines of JSON for another window.

mod json;
mod terminal;
mod window;

pub(super) use json::JsonLines;
pub(super) use terminal::Terminal;
pub(super) use window::Window;

use clap::ValueEnum;
use flotor_study::apparatus::attend::PollResult;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Timeout of one poll for input, so that the handle is watched meanwhile.
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

/// Waits a moment for a line of input; without one returns what the front end has noticed.
fn next_line(lines: &Receiver<String>) -> Result<String, PollResult> {
    lines.recv_timeout(MOMENT).map_err(|none| match none {
        RecvTimeoutError::Timeout => PollResult::Nothing,
        // The input has ended: the window, or standard input, is closed.
        RecvTimeoutError::Disconnected => PollResult::Closed,
    })
}

/// Reads lines in a background thread and returns their channel.
pub(super) fn lines_of(reader: impl BufRead + Send + 'static) -> std::io::Result<Receiver<String>> {
    let (sender, lines) = channel();
    // Detached: a blocking read cannot be interrupted; the thread ends with its reader or the process.
    std::thread::Builder::new().name("flotor-answers".to_owned()).spawn(move || {
        for line in reader.lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    })?;
    Ok(lines)
}
