use super::*;
use std::thread;

/// Fills a fresh ring and says how many records went in.
fn room(capacity: usize) -> usize {
    let (mut sender, _receiver) = ring::<[u64; 1], 1>(capacity);
    std::iter::from_fn(|| sender.push(&[0]).ok()).count()
}

#[test]
fn capacity_is_rounded_up_to_a_power_of_two() {
    assert_eq!([0, 1, 2, 3, 4, 5, 1000].map(room), [1, 1, 2, 4, 4, 8, 1024]);
}

#[test]
fn records_come_out_in_order_through_many_turns_of_the_ring() {
    let (mut sender, mut receiver) = ring(4);
    assert_eq!(receiver.pop(), None::<[u64; 2]>);
    for k in 0..100 {
        assert_eq!(sender.push(&[k, 10 * k]), Ok(()));
        assert_eq!(sender.push(&[k, 10 * k + 1]), Ok(()));
        assert_eq!(receiver.pop(), Some([k, 10 * k]));
        assert_eq!(receiver.pop(), Some([k, 10 * k + 1]));
        assert_eq!(receiver.pop(), None);
    }
    assert_eq!(receiver.dropped(), 0);
}

#[test]
fn a_full_ring_keeps_what_it_has_and_counts_the_rest() {
    let (mut sender, mut receiver) = ring(2);
    assert!(sender.has_room());
    assert_eq!([1, 2, 3, 4].map(|k| sender.push(&[k])), [Ok(()), Ok(()), Err(Full), Err(Full)]);
    assert!(!sender.has_room());
    assert_eq!(receiver.dropped(), 2);

    assert_eq!(receiver.pop(), Some([1]));
    assert!(sender.has_room());
    assert_eq!(sender.push(&[5]), Ok(()));

    let mut rest = Vec::new();
    assert_eq!(receiver.drain(|record| rest.push(record)), 2);
    assert_eq!(rest, [[2], [5]]);
}

#[test]
fn a_drain_takes_what_waited_when_it_began() {
    let (mut sender, mut receiver) = ring(4);
    sender.push(&[1]).unwrap();
    sender.push(&[2]).unwrap();
    let mut taken = Vec::new();
    let count = receiver.drain(|[k]: [u64; 1]| {
        taken.push(k);
        sender.push(&[k + 10]).unwrap();
    });
    assert_eq!((count, taken), (2, vec![1, 2]));
    assert_eq!(receiver.pop(), Some([11]));
}

#[test]
fn counters_may_wrap() {
    let (mut sender, mut receiver) = ring(2);
    let start = usize::MAX; // one push before the counters begin again at zero
    (sender.tail, sender.known_head) = (start, start);
    (receiver.head, receiver.known_tail) = (start, start);
    sender.shared.sender.tail.store(start, Ordering::Relaxed);
    sender.shared.receiver.head.store(start, Ordering::Relaxed);
    assert_eq!([1, 2, 3].map(|k| sender.push(&[k])), [Ok(()), Ok(()), Err(Full)]);
    assert_eq!([receiver.pop(), receiver.pop(), receiver.pop()], [Some([1]), Some([2]), None]);
}

#[test]
fn each_end_learns_that_the_other_is_gone() {
    let (mut sender, mut receiver) = ring(2);
    sender.push(&[1]).unwrap();
    assert!(!receiver.is_abandoned());
    drop(sender);
    assert!(receiver.is_abandoned());
    assert_eq!(receiver.pop(), Some([1]));

    let (sender, receiver) = ring::<[u64; 1], 1>(2);
    assert!(!sender.is_abandoned());
    drop(receiver);
    assert!(sender.is_abandoned());
}

#[test]
fn nothing_is_lost_or_torn_between_threads() {
    const RECORDS: u64 = 200_000;
    let (mut sender, mut receiver) = ring::<[u64; 38], 38>(8);
    thread::scope(|scope| {
        scope.spawn(move || {
            for k in 0..RECORDS {
                while !sender.has_room() {
                    thread::yield_now();
                }
                assert_eq!(sender.push(&[k; 38]), Ok(()), "there was room");
            }
        });
        let mut expected = 0;
        let mut check = |record| {
            assert_eq!(record, [expected; 38]);
            expected += 1;
        };
        while !receiver.is_abandoned() {
            receiver.drain(&mut check);
            thread::yield_now();
        }
        receiver.drain(&mut check);
        assert_eq!((expected, receiver.dropped()), (RECORDS, 0));
    });
}

#[test]
fn every_record_either_arrives_or_is_counted() {
    const RECORDS: u64 = 200_000;
    let (mut sender, mut receiver) = ring(8);
    thread::scope(|scope| {
        scope.spawn(move || (1..=RECORDS).for_each(|k| sender.push(&[k; 38]).unwrap_or(())));
        let (mut arrived, mut newest) = (0, 0);
        let mut check = |record: [u64; 38]| {
            assert_eq!(record, [record[0]; 38], "torn");
            assert!(record[0] > newest, "{} after {newest}", record[0]);
            newest = record[0];
            arrived += 1;
        };
        while !receiver.is_abandoned() {
            receiver.drain(&mut check);
        }
        receiver.drain(&mut check);
        assert_eq!(arrived + receiver.dropped(), RECORDS);
    });
}
