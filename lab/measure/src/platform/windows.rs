//! Windows: models never run in their own process, so waiting only yields the processor.

use std::sync::atomic::AtomicU32;

/// Does nothing: no thread waits.
pub(crate) fn wake(_: &AtomicU32) {}

/// Yields the processor.
pub(crate) fn wait(_: &AtomicU32, _: u32) {
    std::thread::yield_now();
}
