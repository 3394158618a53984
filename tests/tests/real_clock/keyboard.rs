//! A terminal with a key that a test presses.

use serialport::{SerialPort, TTYPort};
use std::io::Write;

/// A pseudo terminal in whose foreground a command runs.
pub(crate) struct Keyboard {
    ours: TTYPort,
    theirs: TTYPort,
}

impl Keyboard {
    pub(crate) fn new() -> Self {
        let (ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
        Self { ours, theirs }
    }

    /// The script of a shell that gives this terminal to a command: the leader of a session gets the one that it opens first.
    pub(crate) fn script(&self) -> String {
        let name = self.theirs.name().expect("a pseudo terminal has a path");
        format!("exec setsid sh -c 'exec \"$@\" <{name}' sh \"$@\"")
    }

    pub(crate) fn press(&mut self, key: u8) {
        self.ours.write_all(&[key]).expect("it is ours");
    }
}
