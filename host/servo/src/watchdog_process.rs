//! Watchdog process: stops the devices of a host that has ended for any reason: SIGKILL, `_exit`, `exec`, a limit of the machine.
//!
//! The host starts its own program once more, as `flotor watchdog`, and passes a handle and a device-specific message for each
//! device over the socket that is the process's standard input (extension `flotor.independent-stop/1`). The process runs no plugin
//! code. It writes the messages when the socket closes without an orderly end, when the host's process or the thread of its loop
//! has ended, and when the host, stopped or traced, sends no heartbeat within the timeout. It has a session of its own, leaves the
//! control groups of the host where possible, and receives no signal that requests its end: it ends with its host, right after.

pub use crate::platform::watchdog_process::{
    HeartbeatSender, WatchdogProcess, is_offered, probe_shared_group, serve,
};
