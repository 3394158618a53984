//! The monotonic clock, and sleeping on it.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Time before the first look at the clock, ns: so long ago is no time before the clock.
const BEFORE_NS: u64 = 3_600_000_000_000;

/// Nanoseconds of the monotonic clock, an hour at the first look. Real-time: bounded, no allocation (the performance counter).
#[inline]
#[must_use]
pub fn monotonic_ns() -> u64 {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    let since = FIRST.get_or_init(Instant::now).elapsed();
    BEFORE_NS + u64::try_from(since.as_nanos()).unwrap_or(u64::MAX - BEFORE_NS)
}

/// Sleeps until a time of the monotonic clock. Real-time: a few system calls; the standard library waits for a timer of high
/// resolution where the system has one (Windows 10, 1803), else in ticks of the system.
#[allow(clippy::disallowed_methods)] // this is the one place that sleeps
pub fn sleep_until(deadline_ns: u64) {
    let left_ns = deadline_ns.saturating_sub(monotonic_ns());
    if left_ns > 0 {
        std::thread::sleep(Duration::from_nanos(left_ns));
    }
}
