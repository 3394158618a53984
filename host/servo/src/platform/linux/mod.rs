//! Linux: absolute sleeps, SCHED_FIFO, signal handlers, anonymous files, handles passed between processes.

pub(crate) mod clock;
mod control_group;
pub(crate) mod group_limits;
pub(crate) mod last_stop;
pub mod process_group;
pub(crate) mod processes;
pub(crate) mod scheduling;
pub(crate) mod shared_memory;
pub(crate) mod watchdog_process;

pub use last_stop::{all_but, block_sent_signals, block_signals, set_blocked, set_of, wait_for_signal};
