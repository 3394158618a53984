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

    /// The calling thread runs the loop.
    ///
    /// # Errors
    /// None.
    pub fn follow_this_thread(&self) -> io::Result<()> {
        match *self {}
    }

    /// Whether it has ended before it was told to.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        match *self {}
    }
}

/// Guards the devices of a host.
///
/// # Errors
/// Always.
pub fn serve(_: i32) -> io::Result<()> {
    is_offered()
}
