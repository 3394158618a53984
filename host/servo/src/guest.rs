//! Guest mode: the loop runs in a library inside another program, which has its own signal handlers, memory and executable.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// Handling of signals in a guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Signals {
    /// All signals stay with the program: no handler is installed, none is restored.
    Program = 1,
    /// Fatal signals stop the devices first; then the program's own handler runs, if it had one.
    StopFirst = 2,
}

/// Code of [`Signals`]; 0: the process is the host's own.
static GUEST: AtomicU8 = AtomicU8::new(0);
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Declares the runs of this process guests of another program: its memory is not locked, and its signals are handled as in
/// `signals`. `program` is the `flotor` executable for the processes that a run starts, if one was found. To be called before the
/// first session; only the first call counts. Not real-time.
pub fn be_guest(signals: Signals, program: Option<PathBuf>) {
    if let Some(program) = program {
        let _ = PROGRAM.set(program);
    }
    let _ = GUEST.compare_exchange(0, signals as u8, Ordering::AcqRel, Ordering::Acquire);
}

/// Returns true in a process that belongs to another program.
#[must_use]
pub fn is_guest() -> bool {
    GUEST.load(Ordering::Acquire) != 0
}

/// Returns true if all signals stay with the other program.
pub(crate) fn program_handles_signals() -> bool {
    GUEST.load(Ordering::Acquire) == Signals::Program as u8
}

/// Returns the `flotor` executable of a guest.
#[must_use]
pub fn program() -> Option<&'static PathBuf> {
    PROGRAM.get()
}
