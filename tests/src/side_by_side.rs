//! Parallel run of test cases that wait for most of their time.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of cases that run at the same time.
const AT_A_TIME: usize = 4;

/// Runs `show` on each case, in parallel on four threads. A panic in a case is passed on after the end of all threads.
pub fn show_each<T: Sync>(cases: &[T], show: impl Fn(&T) + Sync) {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..AT_A_TIME {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    show(case);
                }
            });
        }
    });
}
