//! Carries the news of a coupling between the loop and whoever connects it with the other host.
//!
//! ```text
//!  servo <-> latest-value cells (coupling::Line) <-> this thread <-> flotor_live::NewsSocket <-> bridge <-> network
//! ```
//!
//! A thread for each coupling; the loop never waits for it. Not real-time.

use flotor_core::peer::Dispatch;
use flotor_live::{Directory, NewsSocket, PublishError};
use flotor_servo::coupling::Line;
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Pause between two looks at both sides: half a period at 1 kHz.
const LOOK_PERIOD: Duration = Duration::from_micros(500);

/// Datagrams taken in at a look.
const MOST_AT_ONCE: usize = 256;

/// What was carried to a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Carried {
    /// News that arrived, and was newer than what was there.
    pub arrived: u64,
    /// Ticks of the partner that were passed over: their news was lost, or came after newer news.
    pub lost: u64,
    /// News that came after newer news, or twice.
    pub overtaken: u64,
    /// What came and was no news.
    pub refused: u64,
}

/// A thread that carries; it ends when dropped.
pub struct Carrier {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Carried>>,
}

/// Begins to carry news of a coupling.
///
/// # Errors
/// [`PublishError`]; the run goes on, and its end of the coupling asks for nothing.
pub fn carry(directory: &Directory, coupling: &str, line: Line) -> Result<Carrier, PublishError> {
    let socket = NewsSocket::listen(directory, coupling)?;
    let stop = Arc::new(AtomicBool::new(false));
    let until = Arc::clone(&stop);
    let thread = std::thread::Builder::new().name("flotor-news".to_owned());
    let thread = thread.spawn(move || run(socket, line, &until)).map_err(PublishError::Thread)?;
    Ok(Carrier { stop, thread: Some(thread) })
}

impl Carrier {
    /// Ends it; what was carried.
    #[must_use]
    pub fn finish(mut self) -> Carried {
        self.join()
    }

    fn join(&mut self) -> Carried {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Carrier {
    fn drop(&mut self) {
        self.join();
    }
}

fn run(mut socket: NewsSocket, line: Line, stop: &AtomicBool) -> Carried {
    let Line { told, mut heard } = line;
    let began = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    #[allow(clippy::cast_possible_truncation)] // in the year 2554
    let run = began as u64;
    let mut sent = 0;
    let mut sieve = Sieve::default();
    while !stop.load(Ordering::Relaxed) {
        if let Some((version, dispatch)) = told.read()
            && version != sent
        {
            sent = version;
            socket.tell(&Dispatch { run, ..dispatch });
        }
        // Of what comes together only the last is news; a flood ends here, and goes on after the next look.
        let mut newest = None;
        for _ in 0..MOST_AT_ONCE {
            match socket.hear() {
                Ok(None) => break,
                Ok(Some(dispatch)) => newest = sieve.take(dispatch).or(newest),
                Err(_) => sieve.carried.refused += 1,
            }
        }
        newest.iter().for_each(|newest| heard.publish(newest));
        std::thread::sleep(LOOK_PERIOD);
    }
    sieve.carried
}

/// Lets newer news through and counts the rest.
#[derive(Default)]
struct Sieve {
    newest: Option<Dispatch>,
    carried: Carried,
}

impl Sieve {
    fn take(&mut self, dispatch: Dispatch) -> Option<Dispatch> {
        let Self { newest, carried } = self;
        match newest {
            Some(newest) if !dispatch.is_newer_than(newest) => {
                carried.overtaken += 1;
                return None;
            }
            Some(newest) if dispatch.run == newest.run => carried.lost += dispatch.tick - newest.tick - 1,
            _ => {}
        }
        carried.arrived += 1;
        *newest = Some(dispatch);
        Some(dispatch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::peer::{Account, News};
    use flotor_hal::{Pose, Twist};

    #[test]
    fn only_newer_news_passes_and_the_rest_is_counted() {
        let dispatch = |run, tick| {
            let news = News { pose: Pose::HOME, twist: Twist::ZERO, told_j: 0.0 };
            Dispatch { run, tick, news, account: Account::default() }
        };
        let mut sieve = Sieve::default();
        let came = [(7, 5), (7, 6), (7, 9), (7, 8), (7, 9), (8, 0), (7, 10), (8, 1)];
        let passed: Vec<bool> = came.map(|(run, tick)| sieve.take(dispatch(run, tick)).is_some()).into();
        assert_eq!(passed, [true, true, true, false, false, true, false, true]);
        assert_eq!(sieve.carried, Carried { arrived: 5, lost: 2, overtaken: 3, refused: 0 });
    }
}
