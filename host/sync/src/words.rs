//! Records as 64-bit words.
//!
//! Two threads may touch a record at the same moment only if every piece of it is atomic. Hardware does that
//! for 64 bits at a time, so a record travels as words; that also keeps this crate free of `unsafe`.

use crate::shim::{AtomicU64, Ordering};

/// A plain record that can be written as `N` words and read back: numbers, bit patterns, flags.
///
/// `from_words(&r.to_words())` must give `r` again. Both run in real-time code: keep them bounded, without
/// allocation, and free of panics. `f64::to_bits` and `f64::from_bits` carry a float without loss.
pub trait Words<const N: usize>: Sized {
    /// The record as words.
    fn to_words(&self) -> [u64; N];

    /// The record those words came from.
    fn from_words(words: &[u64; N]) -> Self;
}

/// Words as they are.
impl<const N: usize> Words<N> for [u64; N] {
    #[inline]
    fn to_words(&self) -> [u64; N] {
        *self
    }

    #[inline]
    fn from_words(words: &[u64; N]) -> Self {
        *words
    }
}

/// Room for one record. All accesses are relaxed: the owner's sequence says when they count.
#[derive(Debug)]
pub(crate) struct AtomicWords<const N: usize> {
    words: [AtomicU64; N],
}

impl<const N: usize> AtomicWords<N> {
    /// Not real-time.
    pub(crate) fn new(words: [u64; N]) -> Self {
        Self { words: words.map(AtomicU64::new) }
    }

    /// Real-time: bounded, no allocation.
    // Out of line: inlined, the compiler loads a whole record before the first store and spills what the
    // registers cannot hold. For 38 words that is three times the code and a sixth slower.
    #[inline(never)]
    pub(crate) fn store(&self, words: &[u64; N]) {
        for (slot, word) in self.words.iter().zip(words) {
            slot.store(*word, Ordering::Relaxed);
        }
    }

    /// Real-time: bounded, no allocation.
    #[inline(never)] // for the same reason
    pub(crate) fn load(&self) -> [u64; N] {
        let mut words = [0; N];
        for (word, slot) in words.iter_mut().zip(&self.words) {
            *word = slot.load(Ordering::Relaxed);
        }
        words
    }
}
