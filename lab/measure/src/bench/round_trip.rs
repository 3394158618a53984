//! Round trip of waking another thread and being woken by it: baseline for a model in its own process, whose step is
//! such a round trip through the system's futexes.

use super::TickCost;
use crate::platform::{wait, wake};
use flotor_core::quantile;
use flotor_judge::call_timer::net_ns;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

/// Number of round trips that are timed together.
const BATCH: u32 = 64;
/// Value that ends the other thread.
const OVER: u32 = u32::MAX;

/// Two futex words, one per direction.
#[derive(Default)]
struct Words {
    there: AtomicU32,
    back: AtomicU32,
}

/// Stores a word and wakes its waiter.
fn send(word: &AtomicU32, value: u32) {
    word.store(value, Ordering::Release);
    wake(word);
}

/// Waits until the word differs from `last`.
fn await_other(word: &AtomicU32, last: u32) -> u32 {
    loop {
        let value = word.load(Ordering::Acquire);
        if value != last {
            return value;
        }
        wait(word, last);
    }
}

/// Times batches of round trips between two threads, ns per round trip. Not real-time.
///
/// # Errors
/// Errors of starting the second thread.
pub fn time_round_trips(batches: usize) -> io::Result<TickCost> {
    let words = Arc::new(Words::default());
    let other = Arc::clone(&words);
    let echo = std::thread::Builder::new().spawn(move || {
        let mut last = 0;
        while last != OVER {
            last = await_other(&other.there, last);
            send(&other.back, last);
        }
    })?;
    let mut number = 0;
    let mut batch = |_| {
        let begin = Instant::now();
        for _ in 0..BATCH {
            send(&words.there, number + 1);
            let _ = await_other(&words.back, number);
            number = (number + 1) % (OVER - 1);
        }
        net_ns(0.0, begin) / f64::from(BATCH)
    };
    let mut times_ns: Vec<f64> = (0..batches.max(1)).map(&mut batch).collect();
    send(&words.there, OVER);
    let _ = echo.join();
    let [median_ns, fastest_ns, p99_ns] = [0.5, 0.0, 0.99].map(|part| quantile(&mut times_ns, part));
    Ok(TickCost { median_ns, fastest_ns, p99_ns })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_trip_comes_back() {
        let cost = time_round_trips(3).expect("a thread");
        assert!(cost.fastest_ns > 0.0 && cost.fastest_ns <= cost.median_ns, "{cost:?}");
    }
}
