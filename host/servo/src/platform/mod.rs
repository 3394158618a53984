//! Platform layer of the real-time core. Each operating system has one module with the same items:
//! - `clock`: monotonic clock and sleep;
//! - `scheduling`: priorities, cores, locked memory;
//! - `last_stop`: stop of the devices when the process dies;
//! - `shared_memory`, `processes`: resources shared by the loop and worker processes;
//! - `process_group`: process of plugin code, which ends with its parent, and all processes that it has started;
//! - `watchdog_process`: process that stops devices whose host has ended.
//!
//! Signals exist on Linux only, where the crate `flotor-command` receives them.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use linux as system;
#[cfg(windows)]
use windows as system;

#[cfg(not(windows))]
pub use linux::group_limits::{GroupLimit, LimitValue, Use, group_limits};
#[cfg(not(windows))]
pub use linux::scheduling::real_time_budget_advice;
#[cfg(not(windows))]
pub use linux::{all_but, block_sent_signals, block_signals, set_blocked, set_of, wait_for_signal};
pub use system::process_group;
pub use system::scheduling::{PRIORITY_NAME, THREAD_ADVICE};
pub(crate) use system::{clock, last_stop, processes, scheduling, shared_memory, watchdog_process};

/// Role of a thread, which determines its priority.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Duty {
    /// Thread of the loop.
    Loop,
    /// Model in a worker process: below the loop, which waits for the model with a timeout.
    Worker,
    /// Watchdog, which stops the devices of a stuck loop: above the loop, or at the same priority if the system has none above.
    Watchdog,
}
