//! The watchdog process: it stops devices whose host is gone, whatever ended that: SIGKILL, `_exit`, `exec`, a limit of the
//! machine.
//!
//! The host starts its own program once more, as `flotor watchdog`, and hands it, over the socket that is its standard input,
//! for each device a handle and a message of the device's own (extension `flotor.independent-stop/1`). It runs nothing of any
//! plugin. When the socket closes without an end in order, or the host's process or the thread of its loop has ended, it writes the
//! messages; also when the host, stopped or traced, gives no sign of life for as long as the watchdog waits. It has a session of its own, leaves the control groups of the host where a way leads out of them, and takes no signal
//! that asks it to end: it ends with its host, right after.

pub use crate::platform::watchdog_process::{
    SignOfLife, WatchdogProcess, is_offered, probe_shared_group, serve,
};
