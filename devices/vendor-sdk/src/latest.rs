//! The newest of a few numbers, from one thread to another: neither waits.
//!
//! A version that is odd while the numbers are written; a reader that sees it change reads once more (a sequence lock whose
//! words are atomic, so that it needs no `unsafe`).

use std::sync::atomic::{AtomicU64, Ordering, fence};

/// How often a reader tries: a writer needs tens of nanoseconds unless it is put to sleep in the middle.
const TRIES: usize = 64;

/// The newest `N` numbers, as words.
#[derive(Debug)]
pub(crate) struct Latest<const N: usize> {
    version: AtomicU64,
    words: [AtomicU64; N],
}

impl<const N: usize> Latest<N> {
    pub(crate) const fn new() -> Self {
        Self { version: AtomicU64::new(0), words: [const { AtomicU64::new(0) }; N] }
    }

    /// Replaces them; by one thread at a time. Real-time: bounded, no allocation.
    pub(crate) fn put(&self, words: &[u64; N]) {
        let version = self.version.load(Ordering::Relaxed);
        self.version.store(version + 1, Ordering::Relaxed);
        fence(Ordering::Release);
        self.words.iter().zip(words).for_each(|(place, word)| place.store(*word, Ordering::Relaxed));
        self.version.store(version + 2, Ordering::Release);
    }

    /// How often they were replaced, and they themselves; `None` if a writer sleeps in the middle. Real-time: bounded, no
    /// allocation.
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

    /// How often they were replaced, or are just being.
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
