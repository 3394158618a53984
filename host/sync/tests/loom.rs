//! Every interleaving of the lock-free primitives, and every stale value a core may still see, by loom.
//!
//! ```text
//! RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
//! ```
//!
//! The models are small on purpose: two words show a torn record as well as forty, a ring of two slots wraps
//! after two records, and every further step multiplies the interleavings. For the same reason the ends of a
//! latest-value cell come back from their threads: dropping them there would only be more steps. Where a
//! model could pass because the interesting case never came up, it counts the interleavings in which it did.

#![cfg(loom)]

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use flotor_sync::{Full, Receiver, inbox, latest, ring};
use loom::thread;

/// Two words that belong together: a record is torn if the second is not ten times the first.
type Pair = [u64; 2];

fn pair(k: u64) -> Pair {
    [k, 10 * k]
}

/// The number in a pair that is whole.
fn number([k, tenfold]: Pair) -> u64 {
    assert_eq!(tenfold, 10 * k, "torn");
    k
}

/// The version of a read whose value belongs to it: the models of one word publish each version's number.
fn version((version, [value]): (u64, [u64; 1])) -> u64 {
    assert_eq!(value, version, "another version's value");
    version
}

/// Counts the interleavings in which something came up; the standard atomics are invisible to loom.
struct Sightings(AtomicUsize);

impl Sightings {
    const fn none() -> Self {
        Self(AtomicUsize::new(0))
    }

    fn count_if(&self, came_up: bool) {
        self.0.fetch_add(usize::from(came_up), Relaxed);
    }

    #[track_caller]
    fn assert_any(&self, what: &str) {
        assert!(self.0.load(Relaxed) > 0, "no interleaving in which {what}");
    }
}

#[test]
fn latest_is_never_torn_and_ends_with_the_last_value() {
    static BETWEEN: Sightings = Sightings::none();
    loom::model(|| {
        let (mut publisher, observer) = latest(pair(0));
        let writer = thread::spawn(move || {
            (1..=3).for_each(|k| publisher.publish(&pair(k)));
            publisher
        });
        if let Some((version, value)) = observer.read() {
            assert_eq!(number(value), version, "another version's value");
            BETWEEN.count_if(0 < version && version < 3);
        }
        let _publisher = writer.join().unwrap();
        assert_eq!(observer.read(), Some((3, pair(3))));
    });
    BETWEEN.assert_any("a value between the first and the last was seen");
}

#[test]
fn latest_never_goes_back() {
    static FORWARD: Sightings = Sightings::none();
    loom::model(|| {
        let (mut publisher, observer) = latest([0]);
        let writer = thread::spawn(move || {
            (1..=2).for_each(|k| publisher.publish(&[k]));
            publisher
        });
        let seen = [observer.read(), observer.read()].into_iter().flatten().map(version).collect::<Vec<_>>();
        assert!(seen.is_sorted(), "versions {seen:?}");
        FORWARD.count_if(seen == [1, 2]);
        writer.join().unwrap();
    });
    FORWARD.assert_any("one version was seen, then the next");
}

#[test]
fn two_observers_are_each_right() {
    loom::model(|| {
        let (mut publisher, observer) = latest([0]);
        let other = observer.clone();
        let reader = thread::spawn(move || {
            other.read().map(version);
            other
        });
        let writer = thread::spawn(move || {
            publisher.publish(&[1]);
            publisher
        });
        observer.read().map(version);
        let other = reader.join().unwrap();
        let _publisher = writer.join().unwrap();
        assert_eq!([observer.read(), other.read()], [Some((1, [1])); 2]);
    });
}

/// Takes at most one record and remembers it.
fn pop_into(arrived: &mut Vec<u64>, receiver: &mut Receiver<Pair, 2>) {
    arrived.extend(receiver.pop().map(number));
}

#[test]
fn ring_keeps_order_and_counts_what_it_drops() {
    static ALL_ARRIVED: Sightings = Sightings::none();
    static DROPPED: Sightings = Sightings::none();
    loom::model(|| {
        let (mut sender, mut receiver) = ring(2);
        let pusher = thread::spawn(move || {
            let pushed = [1, 2, 3, 4].map(|k| (k, sender.push(&pair(k))));
            pushed.into_iter().filter(|(_, result)| result.is_ok()).map(|(k, _)| k).collect::<Vec<_>>()
        });
        let mut arrived = Vec::new();
        for _ in 0..2 {
            pop_into(&mut arrived, &mut receiver);
        }
        let pushed = pusher.join().unwrap();
        receiver.drain(|record| arrived.push(number(record)));
        assert_eq!(arrived, pushed, "what went in comes out, once and in order");
        assert_eq!(receiver.dropped(), 4 - pushed.len() as u64);
        ALL_ARRIVED.count_if(pushed.len() == 4);
        DROPPED.count_if(pushed.len() < 4);
    });
    ALL_ARRIVED.assert_any("the ring wrapped twice without a loss");
    DROPPED.assert_any("the ring was full");
}

#[test]
fn room_seen_is_room_kept() {
    static MADE_ROOM: Sightings = Sightings::none();
    loom::model(|| {
        let (mut sender, mut receiver) = ring(1);
        sender.push(&pair(1)).unwrap();
        let popper = thread::spawn(move || {
            assert_eq!(receiver.pop(), Some(pair(1)));
            receiver
        });
        let had_room = sender.has_room();
        let result = sender.push(&pair(2));
        assert!(result.is_ok() || !had_room, "there was room");
        MADE_ROOM.count_if(had_room);
        let mut receiver = popper.join().unwrap();
        assert_eq!(receiver.pop(), result.is_ok().then(|| pair(2)));
        assert_eq!(receiver.dropped(), u64::from(result == Err(Full)));
    });
    MADE_ROOM.assert_any("the receiver made room in time");
}

#[test]
fn abandonment_seen_means_every_record_and_every_drop_seen() {
    static SEEN: Sightings = Sightings::none();
    loom::model(|| {
        let (mut sender, mut receiver) = ring(2);
        let pusher = thread::spawn(move || {
            for k in 1..=3 {
                let _ = sender.push(&pair(k));
            }
        });
        let mut arrived = Vec::new();
        pop_into(&mut arrived, &mut receiver);
        if receiver.is_abandoned() {
            receiver.drain(|record| arrived.push(number(record)));
            assert_eq!(arrived.len() as u64 + receiver.dropped(), 3, "the end came before the last record");
            SEEN.count_if(true);
        }
        pusher.join().unwrap();
        assert!(receiver.is_abandoned());
    });
    SEEN.assert_any("the receiver saw the sender go");
}

#[test]
fn a_sender_that_waits_for_room_learns_that_the_receiver_is_gone() {
    loom::model(|| {
        let (mut sender, receiver) = ring(1);
        sender.push(&pair(1)).unwrap();
        let dropper = thread::spawn(move || drop(receiver));
        while !sender.has_room() && !sender.is_abandoned() {
            thread::yield_now();
        }
        assert!(sender.is_abandoned());
        dropper.join().unwrap();
    });
}

#[test]
fn a_group_arrives_whole_or_not_yet() {
    static WHOLE: Sightings = Sightings::none();
    static NOT_YET: Sightings = Sightings::none();
    loom::model(|| {
        let (sender, mut receiver) = inbox(2);
        let pusher = thread::spawn(move || {
            sender.send_all(&[pair(1), pair(2)]).unwrap();
            // The receiver may have made room by now, or not: all or none either way.
            sender.send_all(&[pair(3), pair(4)]).is_ok()
        });
        let mut arrived = Vec::new();
        let first = receiver.drain(|record| arrived.push(number(record)));
        assert!(first == 0 || first == 2, "a part of a group");
        WHOLE.count_if(first == 2);
        NOT_YET.count_if(first == 0);
        let both = pusher.join().unwrap();
        receiver.drain(|record| arrived.push(number(record)));
        assert_eq!(arrived, if both { vec![1, 2, 3, 4] } else { vec![1, 2] });
    });
    WHOLE.assert_any("a group was there");
    NOT_YET.assert_any("a group was still to come");
}

#[test]
fn two_senders_lose_nothing_and_mix_no_groups() {
    loom::model(|| {
        let (sender, mut receiver) = inbox(4);
        let other = sender.clone();
        let pusher = thread::spawn(move || other.send_all(&[pair(3), pair(4)]).unwrap());
        let mut arrived = Vec::new();
        sender.send_all(&[pair(1), pair(2)]).unwrap();
        receiver.drain(|record| arrived.push(number(record)));
        pusher.join().unwrap();
        receiver.drain(|record| arrived.push(number(record)));
        assert!(arrived == [1, 2, 3, 4] || arrived == [3, 4, 1, 2], "{arrived:?}");
    });
}
