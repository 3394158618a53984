//! Transports the peer state of a coupling between the loop and the bridge to the other host.
//!
//! ```text
//!  servo <-> latest-value cells (coupling::Line) <-> this thread <-> flotor_live::PeerSocket <-> bridge <-> network
//! ```
//!
//! A thread for each coupling; the loop never waits for it. Not real-time.

use flotor_core::peer::Dispatch;
use flotor_live::{Directory, PeerSocket, PublishError};
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

/// Messages on their way to a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkCounts {
    /// Messages that arrived, and were newer than the last.
    pub arrived: u64,
    /// Ticks of the partner that were passed over: their messages were lost, or came after newer ones.
    pub lost: u64,
    /// Messages that came after newer ones, or twice.
    pub overtaken: u64,
    /// Malformed messages.
    pub refused: u64,
}

/// The thread of a peer link; it ends when dropped.
pub struct PeerLink {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<LinkCounts>>,
}

/// Starts the peer link of a coupling.
///
/// # Errors
/// [`PublishError`]; the run goes on, and its end of the coupling asks for nothing.
pub fn start_peer_link(directory: &Directory, coupling: &str, line: Line) -> Result<PeerLink, PublishError> {
    let socket = PeerSocket::listen(directory, coupling)?;
    let stop = Arc::new(AtomicBool::new(false));
    let until = Arc::clone(&stop);
    let thread = std::thread::Builder::new().name("flotor-peer".to_owned());
    let thread = thread.spawn(move || run(socket, line, &until)).map_err(PublishError::Thread)?;
    Ok(PeerLink { stop, thread: Some(thread) })
}

impl PeerLink {
    /// Ends it; what it has counted.
    #[must_use]
    pub fn finish(mut self) -> LinkCounts {
        self.join()
    }

    fn join(&mut self) -> LinkCounts {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for PeerLink {
    fn drop(&mut self) {
        self.join();
    }
}

fn run(mut socket: PeerSocket, line: Line, stop: &AtomicBool) -> LinkCounts {
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
        // Of what comes together only the last counts; a flood ends here, and goes on after the next look.
        let mut newest = None;
        for _ in 0..MOST_AT_ONCE {
            match socket.hear() {
                Ok(None) => break,
                Ok(Some(dispatch)) => newest = sieve.take(dispatch).or(newest),
                Err(_) => sieve.counts.refused += 1,
            }
        }
        newest.iter().for_each(|newest| heard.publish(newest));
        std::thread::sleep(LOOK_PERIOD);
    }
    sieve.counts
}

/// Lets newer messages through and counts the rest.
#[derive(Default)]
struct Sieve {
    newest: Option<Dispatch>,
    counts: LinkCounts,
}

impl Sieve {
    fn take(&mut self, dispatch: Dispatch) -> Option<Dispatch> {
        let Self { newest, counts } = self;
        match newest {
            Some(newest) if !dispatch.is_newer_than(newest) => {
                counts.overtaken += 1;
                return None;
            }
            Some(newest) if dispatch.run == newest.run => counts.lost += dispatch.tick - newest.tick - 1,
            _ => {}
        }
        counts.arrived += 1;
        *newest = Some(dispatch);
        Some(dispatch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::peer::{PeerState, TankState};
    use flotor_hal::{Pose, Twist};

    #[test]
    fn only_newer_messages_pass_and_the_rest_is_counted() {
        let dispatch = |run, tick| {
            let state = PeerState { pose: Pose::HOME, twist: Twist::ZERO, told_j: 0.0 };
            Dispatch { run, tick, state, tank: TankState::default() }
        };
        let mut sieve = Sieve::default();
        let came = [(7, 5), (7, 6), (7, 9), (7, 8), (7, 9), (8, 0), (7, 10), (8, 1)];
        let passed: Vec<bool> = came.map(|(run, tick)| sieve.take(dispatch(run, tick)).is_some()).into();
        assert_eq!(passed, [true, true, true, false, false, true, false, true]);
        assert_eq!(sieve.counts, LinkCounts { arrived: 5, lost: 2, overtaken: 3, refused: 0 });
    }
}
