//! System interface of the checks in child processes. Each system has one module with the same items:
//! - `anonymous_file`, `standard_input`: files for results of a process;
//! - `ending_signal`, `end_at_once`: end of a process;
//! - `processor_time`, `used`: processor times;
//! - `state`: state of this process;
//! - `locked`: check for system calls in a step.

#[cfg(not(windows))]
mod linux;
mod process;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use linux as system;
#[cfg(windows)]
use windows as system;

pub(crate) use process::{May, Part};
pub(crate) use system::{
    anonymous_file, end_at_once, ending_signal, locked, processor_time, standard_input, state, used,
};
