//! What differs between systems when a plugin is judged in a process of its own. Each system has one module with the same items:
//! - `anonymous_file`, `standard_input`: what a process says into;
//! - `ending_signal`, `end_at_once`: how one ends;
//! - `processor_time`, `used`: what the system counts;
//! - `state`: what the system tells of this process;
//! - `locked`: whether a step calls the system.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use linux as system;
#[cfg(windows)]
use windows as system;

pub(crate) use system::{
    anonymous_file, end_at_once, ending_signal, locked, processor_time, standard_input, state, used,
};

use std::time::Duration;

/// What a process did so far, and whether it would do more now.
pub(crate) struct Used {
    /// Time of a processor that it took.
    pub(crate) ran: Duration,
    /// Whether it could run, and waits for nothing but its turn.
    pub(crate) wants: bool,
}
