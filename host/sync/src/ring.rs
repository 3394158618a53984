//! The trace ring: one sender, one receiver, every record in order, a fixed number of slots.
//!
//! Two counters rule it. The sender alone moves `tail` (records ever pushed), the receiver alone moves `head`
//! (records ever popped); record `k` lives in slot `k` modulo the capacity. `tail - head` records wait; the
//! slots from `head` to `tail` belong to the receiver, the others to the sender. Moving a counter hands a
//! slot over, and each side only ever reads the other's counter, so neither can make the other wait.
//!
//! Reading a counter another core has just written costs about as much as the rest of a push. So each side
//! keeps its own counter and the last value it saw of the other's, and looks again only when that value says
//! full or empty.
//!
//! Sources: L. Lamport, "Specifying concurrent program modules", ACM TOPLAS 5 (2), 1983 (the queue); P. Lee,
//! T. Bu and G. Chandranmenon, "A lock-free, cache-efficient multi-core synchronization mechanism for
//! line-rate network traffic monitoring", IPDPS 2010 (private copies of the counters).

use std::marker::PhantomData;

use crate::shim::{Arc, AtomicBool, AtomicU64, AtomicUsize, Exclusive, Ordering};
use crate::words::{AtomicWords, Words};

/// The ring had no free slot: the record was dropped, and counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl std::fmt::Display for Full {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the ring is full, the record was dropped")
    }
}

impl std::error::Error for Full {}

/// What the sender writes. Aligned to two 64-byte cache lines, which x86 prefetches as a pair, so that the
/// receiver's stores never take these lines away from the sender.
#[derive(Debug, Default)]
#[repr(align(128))]
struct SenderSide {
    /// Records ever pushed, wrapping.
    tail: AtomicUsize,
    /// Records that found no room.
    dropped: AtomicU64,
    gone: AtomicBool,
}

/// What the receiver writes; on cache lines of its own for the same reason.
#[derive(Debug, Default)]
#[repr(align(128))]
struct ReceiverSide {
    /// Records ever popped, wrapping.
    head: AtomicUsize,
    gone: AtomicBool,
}

#[derive(Debug)]
struct Slot<const N: usize> {
    words: AtomicWords<N>,
    turn: Exclusive,
}

/// What both ends share.
#[derive(Debug)]
struct Shared<const N: usize> {
    sender: SenderSide,
    receiver: ReceiverSide,
    /// A power of two of them, so that wrapping counters and slots agree.
    slots: Box<[Slot<N>]>,
}

impl<const N: usize> Shared<N> {
    /// The slot of record `index`; a ring has at least one, so there always is one.
    #[inline]
    fn slot(&self, index: usize) -> Option<&Slot<N>> {
        self.slots.get(index & self.slots.len().wrapping_sub(1))
    }
}

/// A ring of at least `capacity` records (rounded up to a power of two, at least 1).
///
/// Not real-time: this is where all its memory is allocated, once.
///
/// # Panics
/// If memory for that many records cannot be had.
#[must_use]
#[allow(clippy::expect_used)] // not real-time
pub fn ring<T: Words<N>, const N: usize>(capacity: usize) -> (Sender<T, N>, Receiver<T, N>) {
    let slot_count = capacity.max(1).checked_next_power_of_two().expect("a ring fits into memory");
    let slot = || Slot { words: AtomicWords::new([0; N]), turn: Exclusive::new() };
    let slots = std::iter::repeat_with(slot).take(slot_count).collect();
    let shared = Arc::new(Shared { sender: SenderSide::default(), receiver: ReceiverSide::default(), slots });
    let sender =
        Sender { shared: Arc::clone(&shared), tail: 0, known_head: 0, dropped: 0, record: PhantomData };
    (sender, Receiver { shared, head: 0, known_tail: 0, record: PhantomData })
}

/// The writing end. There is one: it cannot be cloned, and pushing takes it mutably.
#[derive(Debug)]
pub struct Sender<T, const N: usize> {
    shared: Arc<Shared<N>>,
    /// Own counter, known without a load: nobody else writes it.
    tail: usize,
    /// The receiver's counter when last looked at; the true one is this or further.
    known_head: usize,
    dropped: u64,
    record: PhantomData<fn(&T)>,
}

impl<T: Words<N>, const N: usize> Sender<T, N> {
    /// Appends a record. Wait-free: the receiver cannot delay it.
    ///
    /// Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`Full`] if no slot is free. The record is dropped and counted in [`Receiver::dropped`]: what waits
    /// already is kept, so a recording has a gap and not a moved beginning.
    #[inline(always)] // so that a record becomes words where its parts are, and is nowhere put together
    pub fn push(&mut self, record: &T) -> Result<(), Full> {
        if self.is_full(self.known_head) {
            // Acquire, pairs with the receiver's release store of `head`: it has finished reading the slots
            // up to here. Relaxed, the words stored below could overtake its reads of the record before.
            self.known_head = self.shared.receiver.head.load(Ordering::Acquire);
        }
        let free = if self.is_full(self.known_head) { None } else { self.shared.slot(self.tail) };
        let Some(slot) = free else {
            self.dropped = self.dropped.wrapping_add(1);
            // Relaxed: a statistic. It is exact once the receiver knows that the sender is gone.
            self.shared.sender.dropped.store(self.dropped, Ordering::Relaxed);
            return Err(Full);
        };
        slot.turn.assert_writable();
        slot.words.store(&record.to_words());
        self.tail = self.tail.wrapping_add(1);
        // Release, pairs with the receiver's acquire load of `tail`: who sees the new count sees the words.
        // Relaxed, it could read the slot's old words.
        self.shared.sender.tail.store(self.tail, Ordering::Release);
        Ok(())
    }

    /// Appends several records that become visible at once: whoever sees the first of them sees them all. So a
    /// receiver that drains takes either the whole group or, next time, the whole group. Wait-free.
    ///
    /// Real-time: bounded by the group, no allocation.
    ///
    /// # Errors
    /// [`Full`] if there is no room for all of them. Then none was appended, and all are counted as dropped.
    pub fn push_all(&mut self, records: &[T]) -> Result<(), Full> {
        if self.room_at(self.known_head) < records.len() {
            // Acquire, for the reason given in `push`.
            self.known_head = self.shared.receiver.head.load(Ordering::Acquire);
        }
        if self.room_at(self.known_head) < records.len() {
            self.dropped = self.dropped.wrapping_add(records.len() as u64);
            // Relaxed: a statistic, as in `push`.
            self.shared.sender.dropped.store(self.dropped, Ordering::Relaxed);
            return Err(Full);
        }
        for (index, record) in records.iter().enumerate() {
            if let Some(slot) = self.shared.slot(self.tail.wrapping_add(index)) {
                slot.turn.assert_writable();
                slot.words.store(&record.to_words());
            }
        }
        self.tail = self.tail.wrapping_add(records.len());
        // Release, as in `push`, once for all: one store per record would show a part of the group.
        self.shared.sender.tail.store(self.tail, Ordering::Release);
        Ok(())
    }

    /// How many records can be pushed now; the receiver can only make it more.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn room(&self) -> usize {
        // Relaxed, for the reason given in `has_room`.
        self.room_at(self.shared.receiver.head.load(Ordering::Relaxed))
    }

    /// True if the next push will succeed. Where time is virtual the sender may wait for it, so that a slow
    /// receiver slows the run instead of losing records; whoever waits also asks [`Self::is_abandoned`].
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn has_room(&self) -> bool {
        // Relaxed: nothing is written on the strength of it. The push looks again and sees at least this.
        !self.is_full(self.known_head) || !self.is_full(self.shared.receiver.head.load(Ordering::Relaxed))
    }

    /// True once the receiver is gone: nothing will be taken out any more.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        // Relaxed: the sender reads nothing the receiver wrote on the strength of it.
        self.shared.receiver.gone.load(Ordering::Relaxed)
    }

    /// True if no slot is free when the receiver has come to `head`.
    #[inline]
    fn is_full(&self, head: usize) -> bool {
        self.room_at(head) == 0
    }

    /// Free slots when the receiver has come to `head`.
    #[inline]
    fn room_at(&self, head: usize) -> usize {
        self.shared.slots.len().saturating_sub(self.tail.wrapping_sub(head))
    }
}

impl<T, const N: usize> Drop for Sender<T, N> {
    fn drop(&mut self) {
        // Release, pairs with `Receiver::is_abandoned`: who sees the sender gone sees its last record and its
        // last drop. Relaxed, the receiver could end before it has seen them.
        self.shared.sender.gone.store(true, Ordering::Release);
    }
}

/// The reading end. There is one: it cannot be cloned, and popping takes it mutably.
#[derive(Debug)]
pub struct Receiver<T, const N: usize> {
    shared: Arc<Shared<N>>,
    /// Own counter, known without a load: nobody else writes it.
    head: usize,
    /// The sender's counter when last looked at; the true one is this or further.
    known_tail: usize,
    record: PhantomData<fn() -> T>,
}

impl<T: Words<N>, const N: usize> Receiver<T, N> {
    /// Takes the oldest record, if there is one. Wait-free: the sender cannot delay it.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn pop(&mut self) -> Option<T> {
        if self.head == self.known_tail {
            self.look_for_more();
        }
        self.take_known()
    }

    /// Takes every record that waits at this moment, oldest first, and says how many. What is pushed
    /// meanwhile is left for the next time, so even a busy sender cannot keep the receiver here.
    ///
    /// Real-time: at most one call of `take` per slot of the ring, no allocation of its own.
    #[inline]
    pub fn drain(&mut self, mut take: impl FnMut(T)) -> usize {
        self.look_for_more();
        let mut count = 0;
        while let Some(record) = self.take_known() {
            take(record);
            count += 1;
        }
        count
    }

    /// How many records wait at this moment; the sender can only make it more.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn waiting(&mut self) -> usize {
        self.look_for_more();
        self.known_tail.wrapping_sub(self.head)
    }

    /// How many records can wait at once.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.shared.slots.len()
    }

    /// How many records found no room so far. Exact once the sender is known to be gone.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.shared.sender.dropped.load(Ordering::Relaxed)
    }

    /// True once the sender is gone. Records may still wait, and what is taken out *after* this has said true
    /// is all there will ever be: ask first, then drain. The other way round, the last ones could be missed.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        // Acquire, pairs with the store in the sender's drop.
        self.shared.sender.gone.load(Ordering::Acquire)
    }

    /// Learns how far the sender has come.
    #[inline]
    fn look_for_more(&mut self) {
        // Acquire, pairs with the sender's release store of `tail`: the words up to here are written.
        self.known_tail = self.shared.sender.tail.load(Ordering::Acquire);
    }

    /// Takes the oldest record of those known to wait.
    #[inline]
    fn take_known(&mut self) -> Option<T> {
        if self.head == self.known_tail {
            return None;
        }
        let slot = self.shared.slot(self.head)?;
        slot.turn.assert_readable();
        let words = slot.words.load();
        self.head = self.head.wrapping_add(1);
        // Release, pairs with the sender's acquire load of `head`: the words are read before the slot is
        // given back. Relaxed, the reads could come after the sender's next stores into it.
        self.shared.receiver.head.store(self.head, Ordering::Release);
        Some(T::from_words(&words))
    }
}

impl<T, const N: usize> Drop for Receiver<T, N> {
    fn drop(&mut self) {
        // Relaxed: see `Sender::is_abandoned`.
        self.shared.receiver.gone.store(true, Ordering::Relaxed);
    }
}

#[cfg(all(test, not(loom)))]
mod tests;
