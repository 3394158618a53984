//! Watchdog process: not available yet; starting it for a device that is stopped by a message returns an error.

use super::not_yet;
use flotor_loader::Independence;
use std::io;

/// Returns an error: this system has no watchdog process yet. Not real-time.
///
/// # Errors
/// Always.
pub fn is_offered() -> io::Result<()> {
    Err(not_yet("the watchdog process"))
}

/// Watchdog process of this host: not available yet.
pub enum WatchdogProcess {}

/// Sender of heartbeats to the watchdog process: not available yet.
pub enum HeartbeatSender {}

impl HeartbeatSender {
    /// Sends a heartbeat and announces the next heartbeat within this time, ns.
    pub(crate) fn give(&self, _: u64) {
        match *self {}
    }
}

impl WatchdogProcess {
    /// Returns `None` without a device that is stopped by a message. Not real-time.
    ///
    /// # Errors
    /// If a device is stopped by a message.
    pub fn start<'a>(
        devices: impl IntoIterator<Item = (&'a str, &'a Independence)>,
    ) -> io::Result<Option<Self>> {
        let is_by_message = |means: &Independence| matches!(means, Independence::Message { .. });
        match devices.into_iter().any(|(_, means)| is_by_message(means)) {
            true => is_offered().map(|()| None),
            false => Ok(None),
        }
    }

    /// Returns a sender of heartbeats to the process.
    ///
    /// # Errors
    /// None.
    pub fn heartbeat_sender(&self) -> io::Result<HeartbeatSender> {
        match *self {}
    }

    /// Registers the calling thread as the loop thread.
    ///
    /// # Errors
    /// None.
    pub fn follow_this_thread(&self) -> io::Result<()> {
        match *self {}
    }

    /// Unregisters the loop thread.
    ///
    /// # Errors
    /// None.
    pub fn follow_no_thread(&self) -> io::Result<()> {
        match *self {}
    }

    /// Returns the control group that the process shares with the host: none on this system.
    #[must_use]
    pub fn shared_group(&self) -> Option<&str> {
        match *self {}
    }

    /// Returns true if the process has ended early.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        match *self {}
    }
}

/// Returns an error: this system has no watchdog process yet, and no control groups. Not real-time.
///
/// # Errors
/// Always.
pub fn probe_shared_group() -> io::Result<Option<String>> {
    is_offered().map(|()| None)
}

/// Returns an error: this system has no watchdog process yet. Not real-time.
///
/// # Errors
/// Always.
pub fn serve(_: i32) -> io::Result<()> {
    is_offered()
}
