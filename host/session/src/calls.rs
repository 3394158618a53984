//! Plugin calls outside the loop, each with a name and a time limit.
//!
//! A thread cannot be terminated from outside while it executes plugin code. Plugin calls therefore run in a separate thread; after a
//! timeout the caller abandons the thread and reports the plugin. For calls in the loop the watchdog detects the hang. Not real-time.

mod call;
mod process;
mod thread;

pub use call::{Call, CallError, LIMIT_VARIABLE, STEP_LIMIT_VARIABLE, Unresponsive};
pub(crate) use call::{end_limit, limit, limit_of};
pub use process::{Notice, is_abandoned, on_notice, stop_waits_with};
pub(crate) use process::{abandon, is_to_begin, keeping_machine, notify};
pub(crate) use thread::{CallThread, EndReserve, PendingCall, Progress};
