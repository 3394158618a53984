//! Plugin calls outside the loop, each with a name and a time limit.
//!
//! A thread cannot be ended from outside while plugin code runs in it. Such a call therefore has a thread of its own; the caller waits no
//! longer than a limit, then abandons the thread and names the plugin. In the loop the watchdog does the same. Not real-time.

mod call;
mod limits;
mod machine;
mod process;
mod thread;

pub use call::{Call, CallError, Unresponsive};
pub use limits::{LIMIT_VARIABLE, STEP_LIMIT_VARIABLE};
pub(crate) use limits::{end_limit, limit, limit_of};
pub(crate) use machine::keeping_machine;
pub use process::{Notice, is_abandoned, on_notice, stop_waits_with};
pub(crate) use process::{abandon, is_to_begin, notify};
pub(crate) use thread::{CallThread, EndReserve, PendingCall, Progress};
