//! A loop in a process that belongs to somebody else: a library inside another program, which has its own signal handlers, its
//! own memory and its own executable.

use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// What a guest leaves to the program it is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Signals {
    /// All of them: no handler is installed, none is put back.
    Theirs = 1,
    /// Deadly signals stop the devices first; then the program's own handler runs, if it had one.
    StopFirst = 2,
}

/// 0: the process is the host's own.
static GUEST: AtomicU8 = AtomicU8::new(0);
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// From now on the runs of this process are guests of another program: its memory is not locked, and its signals are what
/// `signals` says. `program` is the `flotor` executable for the processes that a run starts, if one was found. To be called
/// before the first session; the first call stays. Not real-time.
pub fn be_guest(signals: Signals, program: Option<PathBuf>) {
    if let Some(program) = program {
        let _ = PROGRAM.set(program);
    }
    let _ = GUEST.compare_exchange(0, signals as u8, Ordering::AcqRel, Ordering::Acquire);
}

/// True in a process that belongs to another program.
#[must_use]
pub fn is_guest() -> bool {
    GUEST.load(Ordering::Acquire) != 0
}

/// True if the signals are not the host's.
pub(crate) fn leaves_signals() -> bool {
    GUEST.load(Ordering::Acquire) == Signals::Theirs as u8
}

/// The `flotor` executable of a guest.
#[must_use]
pub fn program() -> Option<&'static PathBuf> {
    PROGRAM.get()
}
