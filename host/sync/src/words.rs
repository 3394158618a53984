//! Encoding of records as 64-bit words.
//!
//! Two threads may access a record at the same moment only if every part of it is atomic. Hardware provides that
//! for 64 bits at a time, so a record is stored as words; that also makes `unsafe` unnecessary in this crate.

use crate::shim::{AtomicU64, Ordering};

/// Plain record that can be encoded as `N` words and decoded again: numbers, bit patterns, flags.
///
/// `from_words(&r.to_words())` must equal `r`. Both run in real-time code: they must be bounded, without allocation,
/// and free of panics. `f64::to_bits` and `f64::from_bits` encode a float without loss.
pub trait Words<const N: usize>: Sized {
    /// Encodes the record as words.
    fn to_words(&self) -> [u64; N];

    /// Decodes a record from words.
    fn from_words(words: &[u64; N]) -> Self;
}

/// Identity: an array of words is its own encoding.
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

/// Storage of one record. All accesses are relaxed: the owner's sequence decides whether they count.
#[derive(Debug)]
pub(crate) struct AtomicWords<const N: usize> {
    words: [AtomicU64; N],
}

impl<const N: usize> AtomicWords<N> {
    /// Creates the storage with these words. Not real-time.
    pub(crate) fn new(words: [u64; N]) -> Self {
        Self { words: words.map(AtomicU64::new) }
    }

    /// Stores a record. Real-time: bounded, no allocation.
    // Out of line: inlined, the compiler loads a whole record before the first store and spills what the
    // registers cannot hold. For 38 words that is three times the code and a sixth slower.
    #[inline(never)]
    pub(crate) fn store(&self, words: &[u64; N]) {
        for (slot, word) in self.words.iter().zip(words) {
            slot.store(*word, Ordering::Relaxed);
        }
    }

    /// Loads the record. Real-time: bounded, no allocation.
    #[inline(never)] // for the same reason
    pub(crate) fn load(&self) -> [u64; N] {
        let mut words = [0; N];
        for (word, slot) in words.iter_mut().zip(&self.words) {
            *word = slot.load(Ordering::Relaxed);
        }
        words
    }
}
