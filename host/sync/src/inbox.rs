//! The inbox: any number of senders, one receiver that never waits for them.
//!
//! A [`ring`] whose sending end stands behind a mutex. Senders are panels, scripts and experiments; they may wait for
//! each other. The receiver is the servo; it never touches the mutex, so a sender that is suspended while it holds
//! it delays other senders and nobody else.

#![allow(clippy::disallowed_types)] // who sends may wait for others who send; the loop only receives

use crate::ring::{Full, Receiver, Sender, ring};
use crate::shim::{Arc, Mutex};
use crate::words::Words;
use std::sync::PoisonError;

/// An inbox of at least `capacity` records (rounded up to a power of two, at least 1).
///
/// Not real-time: this is where all its memory is allocated, once.
///
/// # Panics
/// If memory for that many records cannot be had.
#[must_use]
pub fn inbox<T: Words<N>, const N: usize>(capacity: usize) -> (InboxSender<T, N>, Receiver<T, N>) {
    let (sender, receiver) = ring(capacity);
    (InboxSender { sender: Arc::new(Mutex::new(sender)) }, receiver)
}

/// A writing end; clone it for more writers. What one of them sends stays in order; what [`Self::send_all`] sends
/// stays together.
#[derive(Debug)]
pub struct InboxSender<T, const N: usize> {
    sender: Arc<Mutex<Sender<T, N>>>,
}

impl<T: Words<N>, const N: usize> InboxSender<T, N> {
    /// Sends records that the receiver gets in one [`Receiver::drain`], all or none. Not real-time: waits while
    /// another sender is at it.
    ///
    /// # Errors
    /// [`Full`] if there is no room for all of them; then none was sent.
    pub fn send_all(&self, records: &[T]) -> Result<(), Full> {
        // A sender that panicked did so before or after a push, never within: the ring is whole.
        self.sender.lock().unwrap_or_else(PoisonError::into_inner).push_all(records)
    }

    /// True once the receiver is gone: nothing that is sent will be taken. Not real-time, as [`Self::send_all`].
    #[must_use]
    pub fn is_abandoned(&self) -> bool {
        self.sender.lock().unwrap_or_else(PoisonError::into_inner).is_abandoned()
    }
}

/// By hand: derived, it would ask for `T: Clone`.
impl<T, const N: usize> Clone for InboxSender<T, N> {
    fn clone(&self) -> Self {
        Self { sender: Arc::clone(&self.sender) }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn a_group_that_does_not_fit_leaves_nothing_behind() {
        let (sender, mut receiver) = inbox(4);
        sender.send_all(&[[1], [2], [3]]).unwrap();
        assert_eq!(sender.send_all(&[[4], [5]]), Err(Full));
        sender.send_all(&[[6]]).unwrap();
        let mut arrived = Vec::new();
        receiver.drain(|[number]: [u64; 1]| arrived.push(number));
        assert_eq!(arrived, [1, 2, 3, 6]);
    }

    #[test]
    fn a_sender_learns_that_nobody_listens() {
        let (sender, receiver) = inbox::<[u64; 1], 1>(1);
        assert!(!sender.is_abandoned());
        drop(receiver);
        assert!(sender.is_abandoned());
    }

    #[test]
    fn groups_of_many_senders_arrive_whole_and_in_each_senders_order() {
        const GROUPS: u64 = 20_000;
        let (sender, mut receiver) = inbox(64);
        thread::scope(|scope| {
            for name in 0..3 {
                let sender = sender.clone();
                scope.spawn(move || {
                    for group in 0..GROUPS {
                        while sender.send_all(&[[name, group], [name, group], [name, group]]).is_err() {
                            thread::yield_now();
                        }
                    }
                });
            }
            let mut next = [0; 3];
            while next.iter().sum::<u64>() < 3 * GROUPS {
                let mut batch = Vec::new();
                receiver.drain(|record: [u64; 2]| batch.push(record));
                let (groups, rest) = batch.as_chunks::<3>();
                assert!(rest.is_empty(), "a group was split between two drains");
                for group in groups {
                    let [name, number] = group[0];
                    assert_eq!(*group, [group[0]; 3], "another sender came in between");
                    let expected = &mut next[usize::try_from(name).unwrap()];
                    assert_eq!(number, *expected);
                    *expected += 1;
                }
            }
        });
    }
}
