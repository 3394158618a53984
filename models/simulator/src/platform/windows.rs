//! Windows: no sockets that keep messages apart.

use std::io;
use std::path::Path;
use std::process::Child;
use std::time::Duration;

/// End of a pair, which Windows does not have.
pub(crate) enum Socket {}

fn unsupported<T>() -> io::Result<T> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "simulators need a Unix"))
}

impl Socket {
    /// Refuses.
    pub(crate) fn start(_program: &Path) -> io::Result<(Self, Child)> {
        unsupported()
    }

    /// Refuses.
    pub(crate) fn of_standard_input() -> io::Result<Self> {
        unsupported()
    }

    /// Never called.
    pub(crate) fn send(&self, _message: &[u8]) -> io::Result<()> {
        match *self {}
    }

    /// Never called.
    pub(crate) fn receive(&self, _bytes: &mut [u8]) -> io::Result<usize> {
        match *self {}
    }

    /// Never called.
    pub(crate) fn wait(&self, _most: Option<Duration>) -> io::Result<bool> {
        match *self {}
    }
}
