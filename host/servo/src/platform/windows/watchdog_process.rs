//! The watchdog process. There is none yet: of a device that is stopped by a message the run says so.

use super::not_yet;
use flotor_hal::Independence;
use std::io;

/// Whether this system has one. Not real-time.
///
/// # Errors
/// That it has none.
pub fn is_offered() -> io::Result<()> {
    Err(not_yet("the watchdog process"))
}

/// The watchdog process of this host. There is none yet.
pub enum WatchdogProcess {}

/// Tells the watchdog process that this process runs. There is none yet.
pub enum SignOfLife {}

impl SignOfLife {
    /// Announces the next call within this time.
    pub(crate) fn give(&self, _: u64) {
        match *self {}
    }
}

impl WatchdogProcess {
    /// Starts it for the devices that are stopped by a message; `None` if there are none. Not real-time.
    ///
    /// # Errors
    /// There is one.
    pub fn start<'a>(
        devices: impl IntoIterator<Item = (&'a str, &'a Independence)>,
    ) -> io::Result<Option<Self>> {
        let is_by_message = |means: &Independence| matches!(means, Independence::Message { .. });
        match devices.into_iter().any(|(_, means)| is_by_message(means)) {
            true => is_offered().map(|()| None),
            false => Ok(None),
        }
    }

    /// Returns what tells the process that this one runs.
    ///
    /// # Errors
    /// None.
    pub fn sign_of_life(&self) -> io::Result<SignOfLife> {
        match *self {}
    }

    /// The calling thread runs the loop.
    ///
    /// # Errors
    /// None.
    pub fn follow_this_thread(&self) -> io::Result<()> {
        match *self {}
    }

    /// Follows the process alone from now on.
    ///
    /// # Errors
    /// None.
    pub fn follow_no_thread(&self) -> io::Result<()> {
        match *self {}
    }

    /// Returns the control group that the process shares with the host: this system has none.
    #[must_use]
    pub fn shared_group(&self) -> Option<&str> {
        match *self {}
    }

    /// Whether it has ended before it was told to.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        match *self {}
    }
}

/// Returns the control group that a watchdog process would share with this process. Not real-time.
///
/// # Errors
/// Always.
pub fn probe_shared_group() -> io::Result<Option<String>> {
    is_offered().map(|()| None)
}

/// Guards the devices of a host.
///
/// # Errors
/// Always.
pub fn serve(_: i32) -> io::Result<()> {
    is_offered()
}
