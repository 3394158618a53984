//! Bounded queues between the loop and other threads ([`rtrb`]): one sender, one receiver, and neither waits for the other.

use rtrb::RingBuffer;
pub use rtrb::{Consumer, Producer};
use std::mem::MaybeUninit;

/// Creates a queue for `capacity` records and touches its memory: a loop without locked memory would otherwise have a page fault at
/// each new page. Not real-time.
pub fn queue<T: Copy>(capacity: usize) -> (Producer<T>, Consumer<T>) {
    let (mut sender, receiver) = RingBuffer::new(capacity);
    if let Ok(mut slots) = sender.write_chunk_uninit(capacity) {
        slots.as_mut_slices().0.fill(MaybeUninit::zeroed());
    }
    (sender, receiver)
}

/// Passes all records that are pending at the call to `take`, oldest first. Later records wait for the next call, so that a busy
/// sender cannot block the receiver. A record's slot is free before `take` runs.
///
/// Real-time: at most one call of `take` per slot, no allocation of its own.
pub fn drain<T>(receiver: &mut Consumer<T>, take: impl FnMut(T)) {
    (0..receiver.slots()).map_while(|_| receiver.pop().ok()).for_each(take);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drain_takes_what_waited_when_it_began() {
        let (mut sender, mut receiver) = queue(4);
        sender.push_entire_slice(&[1, 2]).unwrap();
        let mut taken = Vec::new();
        drain(&mut receiver, |number| {
            taken.push(number);
            sender.push(number + 10).unwrap();
        });
        assert_eq!(taken, [1, 2]);
        assert_eq!(receiver.pop(), Ok(11));
    }
}
