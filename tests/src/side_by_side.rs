//! Cases of a test that wait for most of their time, shown side by side.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Cases at a time.
const AT_A_TIME: usize = 4;

/// Shows each of the cases, some side by side. Fails if one does, when all are over.
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
