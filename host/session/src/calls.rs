//! Plugin calls outside the loop, each with a name and a time limit.
//!
//! A thread cannot be ended from outside while plugin code runs in it. Such a call therefore has a thread of its own; the caller waits no
//! longer than a limit, then abandons the thread and names the plugin. In the loop the watchdog does the same. Not real-time.

mod call;
mod process;
mod thread;

pub use call::{Call, CallError, LIMIT_VARIABLE, STEP_LIMIT_VARIABLE, Unresponsive};
pub(crate) use call::{end_limit, limit, limit_of};
pub use process::{Notice, is_abandoned, on_notice, stop_waits_with};
pub(crate) use process::{abandon, is_to_begin, keeping_machine, notify};
pub(crate) use thread::{CallThread, EndReserve, PendingCall, Progress};
