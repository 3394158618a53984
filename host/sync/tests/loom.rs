//! Every interleaving of the latest-value cell, and every stale value a core may still see, by loom.
//!
//! ```text
//! RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
//! ```
//!
//! The models are small on purpose: two words show a torn record as well as forty, and every further step multiplies
//! the interleavings. For the same reason the ends of a cell come back from their threads: dropping them there would
//! only be more steps. Where a model could pass because the interesting case never came up, it counts the
//! interleavings in which it did.

#![cfg(loom)]

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use flotor_sync::latest;
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
