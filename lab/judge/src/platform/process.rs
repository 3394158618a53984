//! State of a process, as a system reports it.

use std::time::Duration;

/// Processor time of a process, with the runnable state of its threads.
pub(crate) struct Used {
    /// Processor time so far.
    pub(crate) ran: Duration,
    /// True if a thread is running, runnable, or waiting for a disk or a page; false if the process is idle by choice, and always
    /// on Windows.
    pub(crate) wants: bool,
}

/// Permitted change of a part of the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code)] // unused on a system that does not report open files
pub(crate) enum May {
    /// No change.
    Stay,
    /// New lines, but none removed.
    Grow,
    /// New lines while an instance exists, none of which is there after it.
    GrowInLife,
}

/// Part of the state: name, permitted change, and descriptive lines.
pub(crate) type Part = (&'static str, May, Vec<String>);
