//! Monotonic clock; sleep until a time, or until a word of memory changes.

use rustix::thread::{ClockId, clock_nanosleep_absolute, futex};
use rustix::time::{Timespec, clock_gettime};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// Returns the time of the monotonic clock, ns. Real-time: bounded, no allocation (a vDSO call).
#[inline]
#[must_use]
#[allow(clippy::cast_sign_loss)] // the monotonic clock starts at boot
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Sleeps until a time of the monotonic clock. Real-time: one system call.
#[allow(clippy::cast_possible_wrap)] // seconds since boot
pub fn sleep_until(deadline_ns: u64) {
    let request = Timespec {
        tv_sec: (deadline_ns / 1_000_000_000) as i64,
        tv_nsec: (deadline_ns % 1_000_000_000) as i64,
    };
    // An interrupted sleep is harmless: the spin afterwards reads the clock.
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &request);
}

/// Sleeps until [`wake_all`] or the timeout, if the word is zero. Not real-time.
pub(crate) fn sleep_while_zero(word: &AtomicU32, timeout: Duration) {
    let _ = futex::wait(word, futex::Flags::PRIVATE, 0, Timespec::try_from(timeout).ok().as_ref());
}

/// Wakes all threads that sleep on the word. Real-time: one system call.
pub(crate) fn wake_all(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::PRIVATE, i32::MAX.cast_unsigned());
}
