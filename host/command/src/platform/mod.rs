//! Platform layer of commands: requests to end a run, the terminal, standard output, other programs.
//!
//! Each operating system has one module with the same items.

mod request;
#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use unix as system;
#[cfg(windows)]
use windows as system;

pub(crate) use request::Request;
pub use system::INTERRUPTED;
pub(crate) use system::{
    KeyTerminal, Requests, accept_interrupts, ask_to_end, become_program, die_by, divide, is_orphaned,
    outlive_requests, results_apart, stack_limit_bytes,
};
