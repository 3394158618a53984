//! Where a person sees screens and answers: words on a terminal, the viewer's window, or lines of JSON for a window of one's own.

mod json;
mod terminal;
mod window;

pub(super) use json::JsonLines;
pub(super) use terminal::Terminal;
pub(super) use window::Window;

use clap::ValueEnum;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// How long the handle goes unwatched at most while somebody thinks.
const MOMENT: Duration = Duration::from_millis(50);

/// `--screen`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ScreenOption {
    /// The viewer's window, in front of the person
    #[default]
    Viewer,
    /// Words on this terminal, answers by keyboard
    Terminal,
    /// A screen per line of JSON on standard output, an input per line on standard input
    Json,
}

/// `--stop-key`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum StopKeyOption {
    /// Escape
    #[default]
    Escape,
    /// The space bar
    Space,
    /// F12
    F12,
}

impl StopKeyOption {
    /// As the viewer takes it.
    fn word(self) -> &'static str {
        match self {
            Self::Escape => "escape",
            Self::Space => "space",
            Self::F12 => "f12",
        }
    }
}

/// Lines as they come.
pub(super) fn lines_of(reader: impl BufRead + Send + 'static) -> std::io::Result<Receiver<String>> {
    let (sender, lines) = channel();
    // Ends with its reader or with the process: nothing can call it back from a read.
    std::thread::Builder::new().name("flotor-answers".to_owned()).spawn(move || {
        for line in reader.lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    })?;
    Ok(lines)
}
