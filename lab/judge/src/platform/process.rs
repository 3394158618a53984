//! State of a process, as a system reports it.

use std::time::Duration;

/// Processor time of a process, with its readiness to run.
pub(crate) struct Used {
    /// Processor time so far.
    pub(crate) ran: Duration,
    /// True if the process could run and waits only for its turn.
    pub(crate) wants: bool,
}

/// Permitted change of a part of the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code)] // a system that tells of no files has none that grows
pub(crate) enum May {
    /// No change.
    Stay,
    /// New lines, but none removed.
    Grow,
}

/// Part of the state: name, permitted change, and descriptive lines.
pub(crate) type Part = (&'static str, May, Vec<String>);
