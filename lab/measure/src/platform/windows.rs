//! Windows: no model has a process of its own yet, so nobody sleeps: a thread gives its turn away.

use std::sync::atomic::AtomicU32;

/// Wakes who sleeps on a word: nobody does.
pub(crate) fn wake(_: &AtomicU32) {}

/// Gives the turn away.
pub(crate) fn wait(_: &AtomicU32, _: u32) {
    std::thread::yield_now();
}
