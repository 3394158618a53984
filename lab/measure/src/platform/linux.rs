//! Linux: futexes.

use rustix::thread::futex;
use std::sync::atomic::AtomicU32;

/// Wakes who sleeps on a word.
pub(crate) fn wake(word: &AtomicU32) {
    let _ = futex::wake(word, futex::Flags::empty(), 1);
}

/// Sleeps while a word is `value`; may wake earlier.
pub(crate) fn wait(word: &AtomicU32, value: u32) {
    let _ = futex::wait(word, futex::Flags::empty(), value, None);
}
