//! Wall clock of this machine.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Returns the time since 1970; 0 before.
pub(crate) fn since_1970() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
