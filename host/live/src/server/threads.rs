//! Threads of the server.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Stack size of the threads of the server, bytes: small, because every page of a stack is resident if memory is locked.
const STACK_BYTES: usize = 256 * 1024;

/// Returns a builder for a thread of the server, with a small stack.
pub(super) fn thread(name: &str) -> std::thread::Builder {
    std::thread::Builder::new().name(name.to_owned()).stack_size(STACK_BYTES)
}

/// Waits for the end of a thread until the deadline, then detaches it.
pub(super) fn join_until(thread: JoinHandle<()>, until: Instant) {
    while !thread.is_finished() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(1));
    }
    if thread.is_finished() {
        let _ = thread.join();
    }
}
