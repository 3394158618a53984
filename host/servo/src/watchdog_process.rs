//! Watchdog process: stops the devices of a host that has ended for any reason, such as SIGKILL, `_exit`, `exec` or a resource limit.
//!
//! The host starts a second process of its own program, `flotor watchdog`, and passes a handle and a device-specific message for
//! each device over the socket that is the process's standard input (extension `flotor.independent-stop/1`). The process runs no
//! plugin code. It writes the messages when the socket closes without an orderly end, when the host's process or its loop thread
//! has ended, and when the host, suspended or traced, sends no heartbeat within the timeout. It has a session of its own and leaves
//! the control groups of the host where possible, so that it receives no signal that ends the host; it ends right after its host.

pub use crate::platform::watchdog_process::{
    HeartbeatSender, WatchdogProcess, is_offered, probe_shared_group, serve,
};
