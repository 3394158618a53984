//! Monotonic clock and sleep.

use std::sync::OnceLock;
use std::sync::atomic::AtomicU32;
use std::time::{Duration, Instant};

/// Time of the clock at its first reading, ns: no time of the past is negative.
const BEFORE_NS: u64 = 3_600_000_000_000;

/// Returns the time of the monotonic clock, ns; the first reading is one hour. Real-time: bounded, no allocation (the performance
/// counter).
#[inline]
#[must_use]
pub fn monotonic_ns() -> u64 {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    let since = FIRST.get_or_init(Instant::now).elapsed();
    BEFORE_NS + u64::try_from(since.as_nanos()).unwrap_or(u64::MAX - BEFORE_NS)
}

/// Sleeps until a time of the monotonic clock. Real-time: a few system calls; the standard library waits for a timer of high
/// resolution where the system has one (Windows 10, 1803), otherwise for the system tick.
#[allow(clippy::disallowed_methods)] // this is the one place that sleeps
pub fn sleep_until(deadline_ns: u64) {
    let left_ns = deadline_ns.saturating_sub(monotonic_ns());
    if left_ns > 0 {
        std::thread::sleep(Duration::from_nanos(left_ns));
    }
}

/// Sleeps for one poll interval (5 ms) or the timeout, whichever is shorter, without reading the word: the caller polls.
#[allow(clippy::disallowed_methods)]
pub(crate) fn sleep_while_zero(_: &AtomicU32, timeout: Duration) {
    std::thread::sleep(timeout.min(Duration::from_millis(5)));
}

/// Does nothing: [`sleep_while_zero`] polls.
pub(crate) fn wake_all(_: &AtomicU32) {}
