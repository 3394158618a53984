//! Latest value of a few words, from one writer thread to readers; no thread waits for another.
//!
//! Sequence lock with atomic words, and so without `unsafe`: the version is odd while the words are written; a reader
//! retries if the version changes during the read.

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Number of attempts of a reader: a write takes tens of nanoseconds, unless the writer is suspended during it.
const TRIES: usize = 64;

/// Latest value of `N` words.
#[derive(Debug)]
pub(crate) struct Latest<const N: usize> {
    version: AtomicU64,
    words: [AtomicU64; N],
}

impl<const N: usize> Latest<N> {
    pub(crate) const fn new() -> Self {
        Self { version: AtomicU64::new(0), words: [const { AtomicU64::new(0) }; N] }
    }

    /// Replaces the words; by one thread at a time. Real-time: bounded, no allocation.
    pub(crate) fn put(&self, words: &[u64; N]) {
        let version = self.version.load(Ordering::Relaxed);
        self.version.store(version + 1, Ordering::Relaxed);
        fence(Ordering::Release);
        self.words.iter().zip(words).for_each(|(place, word)| place.store(*word, Ordering::Relaxed));
        self.version.store(version + 2, Ordering::Release);
    }

    /// Returns the number of replacements and the words; `None` if a writer was suspended during a write. Real-time:
    /// bounded, no allocation.
    pub(crate) fn get(&self) -> Option<(u64, [u64; N])> {
        for _ in 0..TRIES {
            let before = self.version.load(Ordering::Acquire);
            let mut words = [0; N];
            words.iter_mut().zip(&self.words).for_each(|(word, place)| *word = place.load(Ordering::Relaxed));
            fence(Ordering::Acquire);
            if before.is_multiple_of(2) && self.version.load(Ordering::Relaxed) == before {
                return Some((before / 2, words));
            }
            std::hint::spin_loop();
        }
        None
    }

    /// Returns the number of completed replacements.
    pub(crate) fn count(&self) -> u64 {
        self.version.load(Ordering::Acquire) / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn what_is_read_was_written_together() {
        let (cell, is_over) = (Latest::<24>::new(), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for number in 1..=200_000 {
                    cell.put(&[number; 24]);
                }
                is_over.store(true, Ordering::Release);
            });
            let mut newest = 0;
            while !is_over.load(Ordering::Acquire) {
                let Some((count, words)) = cell.get() else { continue };
                assert!(words.iter().all(|word| *word == count), "{words:?} of {count}");
                assert!(count >= newest);
                newest = count;
            }
        });
        assert_eq!(cell.get(), Some((200_000, [200_000; 24])));
    }
}
