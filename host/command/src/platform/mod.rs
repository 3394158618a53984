//! What differs between systems for a command: what asks a run to end, the terminal, standard output, other programs.
//!
//! Each system has one module with the same items.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use unix as system;
#[cfg(windows)]
use windows as system;

pub use system::INTERRUPTED;
pub(crate) use system::{
    KeyTerminal, Requests, accept_interrupts, ask_to_end, become_program, die_by, divide, is_orphaned,
    outlive_requests, results_apart, stack_limit_bytes,
};

/// What asks a run to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// In order, unless it is repeated.
    End,
    /// At once.
    Emergency,
}
