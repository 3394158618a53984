//! Parallel loops over index ranges, one thread for each processor. Not real-time.

use std::ops::Range;
use std::thread;

/// Minimum number of indices per thread: below, starting a thread costs more than it saves.
const LEAST: usize = 20_000;

/// Returns the results of `work` on consecutive ranges that cover `0..count`, in their order. The ranges depend on the number of
/// processors; a caller must combine the results so that the outcome does not.
pub(crate) fn on_ranges<T: Send>(count: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(count / LEAST).max(1);
    let part = count.div_ceil(threads);
    let ranges = (0..threads).map(|i| (i * part).min(count)..((i + 1) * part).min(count));
    if threads == 1 {
        return ranges.map(work).collect();
    }
    thread::scope(|scope| {
        let work = &work;
        let started: Vec<_> = ranges.map(|range| scope.spawn(move || work(range))).collect();
        let join = |thread: thread::ScopedJoinHandle<'_, T>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        started.into_iter().map(join).collect()
    })
}

/// Sets each element of a slice from its index.
pub(crate) fn fill<T: Send>(values: &mut [T], make: impl Fn(usize) -> T + Sync) {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(values.len() / LEAST).max(1);
    let part = values.len().div_ceil(threads).max(1);
    let set = |first: usize, values: &mut [T]| {
        values.iter_mut().enumerate().for_each(|(i, value)| *value = make(first + i));
    };
    thread::scope(|scope| {
        let set = &set;
        for (number, values) in values.chunks_mut(part).enumerate() {
            scope.spawn(move || set(number * part, values));
        }
    });
}
