//! Latest-value cell: one writer, any number of readers; only the newest value is available.
//!
//! The cell is a sequence lock. The writer makes the sequence odd, writes the words, and makes the sequence even again.
//! A reader loads the sequence, copies the words, and loads the sequence once more: if it is even and unchanged, no
//! write ran in between, so the copy is consistent. The writer never reads the readers' state and so never waits for a
//! reader; a reader that overlapped with a write retries, a few times.
//!
//! Source: H.-J. Boehm, "Can seqlocks get along with programming language memory models?", MSPC 2012
//! (the variant with atomic data and fences).

use std::marker::PhantomData;

use crate::shim::{Arc, AtomicU64, Ordering, fence};
use crate::words::{AtomicWords, Words};

/// Attempts per read. A copy takes tens of nanoseconds and the servo publishes at most every
/// 100 µs, so a second attempt is rare, and a third means that the writer was suspended during a
/// publish: more would be spinning. Under loom one: its models read several times themselves, and each
/// attempt multiplies the interleavings without adding a new kind.
const READ_ATTEMPTS: usize = if cfg!(loom) { 1 } else { 3 };

/// State shared by both ends. Aligned to two 64-byte cache lines, which x86 prefetches as a pair (and which are
/// one line on some aarch64 cores), so that no neighbour on the heap shares a line with the cell.
#[derive(Debug)]
#[repr(align(128))]
struct Cell<const N: usize> {
    /// Twice the number of published values; odd while one is being written.
    sequence: AtomicU64,
    words: AtomicWords<N>,
}

/// Creates a latest-value cell with the value `initial` as version 0; returns its writing and its reading end. Not
/// real-time: allocates, once.
#[must_use]
pub fn latest<T: Words<N>, const N: usize>(initial: T) -> (Publisher<T, N>, Observer<T, N>) {
    let words = AtomicWords::new(initial.to_words());
    let cell = Arc::new(Cell { sequence: AtomicU64::new(0), words });
    let publisher = Publisher { cell: Arc::clone(&cell), sequence: 0, record: PhantomData };
    (publisher, Observer { cell, record: PhantomData })
}

/// Writing end of a cell. A cell has only one writing end: the type is not `Clone`, and publishing takes it mutably.
#[derive(Debug)]
pub struct Publisher<T, const N: usize> {
    cell: Arc<Cell<N>>,
    /// Sequence of the cell, known without a load because only this end writes it. Always even here.
    sequence: u64,
    record: PhantomData<fn(&T)>,
}

impl<T: Words<N>, const N: usize> Publisher<T, N> {
    /// Publishes `value` as the newest value. Wait-free: readers cannot delay it.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn publish(&mut self, value: &T) {
        // Before the sequence turns odd, because a panic in `to_words` would leave the sequence odd.
        let words = value.to_words();
        let writing = self.sequence.wrapping_add(1);
        self.sequence = self.sequence.wrapping_add(2);

        self.cell.sequence.store(writing, Ordering::Relaxed);
        // Release fence, pairs with the reader's acquire fence: whoever sees one of the new words also sees
        // the odd sequence. Without it the new words could show before it, and a reader that took some of
        // them would find the sequence unchanged.
        fence(Ordering::Release);
        self.cell.words.store(&words);
        // Release, pairs with the reader's acquire load: whoever sees the even sequence sees all new words.
        // Relaxed, a reader could take old words for the new version.
        self.cell.sequence.store(self.sequence, Ordering::Release);
    }
}

/// Reading end of a cell; clone it for more readers.
#[derive(Debug)]
pub struct Observer<T, const N: usize> {
    cell: Arc<Cell<N>>,
    record: PhantomData<fn() -> T>,
}

impl<T: Words<N>, const N: usize> Observer<T, N> {
    /// Returns the newest value and its version: the number of values published so far, 0 for the initial value. For
    /// one reader versions never decrease; an unchanged version means an unchanged value.
    ///
    /// Returns `None` if each of a few attempts overlapped with a write; retry later.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn read(&self) -> Option<(u64, T)> {
        (0..READ_ATTEMPTS).find_map(|_| self.attempt())
    }

    /// Returns as [`Self::read`] does, but `None` without a value later than `version`, which is then not copied.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn read_after(&self, version: u64) -> Option<(u64, T)> {
        // Relaxed: only the attempts of `read` order the words.
        let is_later = self.cell.sequence.load(Ordering::Relaxed) / 2 > version;
        is_later.then(|| self.read()).flatten()
    }

    /// Copies the value once; returns `None` if the copy overlapped with a write.
    #[inline]
    fn attempt(&self) -> Option<(u64, T)> {
        // Acquire, pairs with the release store that ends a publish: the words read below are at least as new
        // as this sequence.
        let before = self.cell.sequence.load(Ordering::Acquire);
        if before % 2 == 1 {
            return None;
        }
        let words = self.cell.words.load();
        // Acquire fence, pairs with the writer's release fence: if any word above came from a later publish,
        // the load below sees that the sequence has moved on. Without it this load could be served early, or
        // stale.
        fence(Ordering::Acquire);
        let after = self.cell.sequence.load(Ordering::Relaxed);
        (after == before).then(|| (before / 2, T::from_words(&words)))
    }
}

/// Implemented by hand, because a derive would require `T: Clone`.
impl<T, const N: usize> Clone for Observer<T, N> {
    fn clone(&self) -> Self {
        Self { cell: Arc::clone(&self.cell), record: PhantomData }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn the_initial_value_is_version_zero() {
        let (_publisher, observer) = latest([7, 8]);
        assert_eq!(observer.read(), Some((0, [7, 8])));
    }

    #[test]
    fn each_publish_is_one_version_and_every_observer_sees_the_newest() {
        let (mut publisher, first) = latest([0]);
        let second = first.clone();
        publisher.publish(&[10]);
        publisher.publish(&[20]);
        assert_eq!(first.read(), Some((2, [20])));
        assert_eq!(second.read(), Some((2, [20])));
    }

    #[test]
    fn a_value_is_read_once_by_who_asks_for_later_ones() {
        let (mut publisher, observer) = latest([0]);
        assert_eq!(observer.read_after(0), None);
        publisher.publish(&[10]);
        assert_eq!(observer.read_after(0), Some((1, [10])));
        assert_eq!(observer.read_after(1), None);
    }

    #[test]
    fn the_last_value_outlives_its_publisher() {
        let (mut publisher, observer) = latest([0]);
        publisher.publish(&[1]);
        drop(publisher);
        assert_eq!(observer.read(), Some((1, [1])));
    }

    #[test]
    fn a_publish_that_never_ends_costs_a_reader_a_few_attempts() {
        let (publisher, observer) = latest([0]);
        publisher.cell.sequence.store(1, Ordering::Relaxed); // as if suspended in the middle
        assert_eq!(observer.read(), None);
    }

    #[test]
    fn readers_on_other_threads_see_whole_values_in_order() {
        const VALUES: u64 = 200_000;
        let (mut publisher, observer) = latest([0; 38]);
        thread::scope(|scope| {
            for observer in [observer.clone(), observer] {
                scope.spawn(move || {
                    let mut newest = 0;
                    while newest < VALUES {
                        let Some((version, words)) = observer.read() else { continue };
                        assert!(version >= newest, "version {version} after {newest}");
                        assert_eq!(words, [version; 38], "torn");
                        newest = version;
                    }
                });
            }
            (1..=VALUES).for_each(|k| publisher.publish(&[k; 38]));
        });
    }
}
