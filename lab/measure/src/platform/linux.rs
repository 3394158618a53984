//! Linux: futexes.

use rustix::thread::futex;
use std::sync::atomic::AtomicU32;

/// Wakes the waiter on a word.
pub(crate) fn wake(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::empty(), 1);
}

/// Waits while a word is `value`; may return early.
pub(crate) fn wait(word: &AtomicU32, value: u32) {
    let _ = futex::wait(word, futex::Flags::empty(), value, None);
}
