//! Guest mode: the loop runs in a library inside a surrounding program, which has its own signal handlers, memory and executable.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// Handling of signals in guest mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Signals {
    /// The surrounding program handles all signals: the host installs no handler and restores none.
    Program = 1,
    /// Fatal signals stop the devices first; then the surrounding program's handler runs, or the default action.
    StopFirst = 2,
}

/// Code of [`Signals`]; 0: not a guest.
static GUEST: AtomicU8 = AtomicU8::new(0);
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Enters guest mode: the memory of this process is not locked, and its signals are handled as in `signals`. `program` is the
/// `flotor` executable for the processes that a run starts, if one was found. Call this function before the first session; a later
/// call can only add a missing `program`. Not real-time.
pub fn be_guest(signals: Signals, program: Option<PathBuf>) {
    if let Some(program) = program {
        let _ = PROGRAM.set(program);
    }
    let _ = GUEST.compare_exchange(0, signals as u8, Ordering::AcqRel, Ordering::Acquire);
}

/// Returns true in guest mode, after [`be_guest`].
#[must_use]
pub fn is_guest() -> bool {
    GUEST.load(Ordering::Acquire) != 0
}

/// Returns true in guest mode with [`Signals::Program`].
pub(crate) fn program_handles_signals() -> bool {
    GUEST.load(Ordering::Acquire) == Signals::Program as u8
}

/// Returns the `flotor` executable set by [`be_guest`]; `None` if none is set.
#[must_use]
pub fn program() -> Option<&'static PathBuf> {
    PROGRAM.get()
}
