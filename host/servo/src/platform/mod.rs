//! What differs between systems in the real-time core. Each system has one module with the same items:
//! - `clock`: the monotonic clock, and sleeping on it;
//! - `scheduling`: priorities, cores, locked memory;
//! - `last_stop`: what is done with a process that dies;
//! - `shared_memory`, `processes`: what a model in a process of its own shares with the loop;
//! - `watchdog_process`: what stops devices whose host is gone.
//!
//! Signals are Linux's alone; what hears them, in another crate, is of that system as well.

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
pub use linux::{block_signals, leave_sent_signals_to_the_loop, wait_for_signal};
pub use system::scheduling::{PRIORITY_NAME, THREAD_ADVICE};
pub(crate) use system::{clock, last_stop, processes, scheduling, shared_memory, watchdog_process};
