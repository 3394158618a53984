//! Front end for a separate window program: screens and inputs as lines of JSON.

use super::next_input;
use flotor_study::apparatus::attend::{FrontEnd, PollResult};
use flotor_study::conduct::ApparatusOrFrontEndError;
use flotor_study::screen::{Screen, Warning, WindowMessage, WindowReply};
use std::io::{ErrorKind, Write};
use std::sync::mpsc::Receiver;

/// Front end that exchanges lines of JSON with a window program.
pub(in crate::study) struct JsonLines<W> {
    lines: Receiver<String>,
    out: W,
}

impl<W: Write> JsonLines<W> {
    /// Creates the front end from input lines and an output stream.
    pub(in crate::study) fn new(lines: Receiver<String>, out: W) -> Self {
        Self { lines, out }
    }

    fn report(&mut self, message: &WindowMessage) -> Result<(), ApparatusOrFrontEndError> {
        let line = serde_json::to_string(message)?;
        match writeln!(self.out, "{line}").and_then(|()| self.out.flush()) {
            // Ignore the error: the end of the input reports a closed window.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        }
    }
}

impl<W: Write> FrontEnd for JsonLines<W> {
    fn show(&mut self, screen: &Screen) -> Result<(), ApparatusOrFrontEndError> {
        self.report(&WindowMessage::Screen(screen.clone()))
    }

    fn poll(&mut self, _screen: &Screen) -> Result<PollResult, ApparatusOrFrontEndError> {
        let polled = next_input(&self.lines, |line| {
            WindowReply::read(line).map(|reply| match reply {
                WindowReply::Input(input) => PollResult::Input(input),
                WindowReply::Window { .. } => PollResult::Nothing,
            })
        });
        polled.or_else(|why| self.refuse(&why).map(|()| PollResult::Nothing))
    }

    fn warn_out_of_range(&mut self) -> Result<(), ApparatusOrFrontEndError> {
        self.report(&WindowMessage::Warning { warning: Warning::OutOfRange })
    }

    fn refuse(&mut self, why: &str) -> Result<(), ApparatusOrFrontEndError> {
        self.report(&WindowMessage::Refused { refused: why.to_owned() })
    }
}
