//! Screens and inputs as lines of JSON, for a separate window program.

use super::MOMENT;
use flotor_study::apparatus::attend::{FrontEnd, Heard};
use flotor_study::conduct::OutsideError;
use flotor_study::screen::{Said, Screen, Told, Warning};
use std::io::{ErrorKind, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError};

/// Front end over lines of JSON in both directions.
pub(in crate::study) struct JsonLines<W> {
    lines: Receiver<String>,
    out: W,
}

impl<W: Write> JsonLines<W> {
    /// Creates the front end from input lines and an output stream.
    pub(in crate::study) fn new(lines: Receiver<String>, out: W) -> Self {
        Self { lines, out }
    }

    fn report(&mut self, told: &Told) -> Result<(), OutsideError> {
        let line = serde_json::to_string(told)?;
        match writeln!(self.out, "{line}").and_then(|()| self.out.flush()) {
            // Ignored: a closed window is detected by the end of its input.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            other => Ok(other?),
        }
    }
}

impl<W: Write> FrontEnd for JsonLines<W> {
    fn show(&mut self, screen: &Screen) -> Result<(), OutsideError> {
        self.report(&Told::Screen(screen.clone()))
    }

    fn poll(&mut self, _screen: &Screen) -> Result<Heard, OutsideError> {
        let line = match self.lines.recv_timeout(MOMENT) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => return Ok(Heard::Nothing),
            // The input has ended: the window is closed.
            Err(RecvTimeoutError::Disconnected) => return Ok(Heard::Closed),
        };
        match Said::read(&line) {
            Ok(Said::Input(input)) => Ok(Heard::Input(input)),
            Ok(Said::Window { .. }) => Ok(Heard::Nothing),
            Err(error) => {
                self.refuse(&error)?;
                Ok(Heard::Nothing)
            }
        }
    }

    fn warn_out_of_range(&mut self) -> Result<(), OutsideError> {
        self.report(&Told::Warning { warning: Warning::OutOfRange })
    }

    fn refuse(&mut self, why: &str) -> Result<(), OutsideError> {
        self.report(&Told::Refused { refused: why.to_owned() })
    }
}
