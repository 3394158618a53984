//! Peer link: transports the peer state of a coupling between the loop and the bridge to the other host.
//!
//! ```text
//!  servo <-> latest-value cells (coupling::Line) <-> this thread <-> flotor_live::PeerSocket <-> bridge <-> network
//! ```
//!
//! One thread for each coupling; the loop never waits for it. Not real-time.

use flotor_coupling::Line;
use flotor_live::{Directory, LinkCounts, Pairing, PeerSocket, PublishError};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Poll interval for the loop's peer state and for the socket: half a period at 1 kHz.
const LOOK_PERIOD: Duration = Duration::from_micros(500);

/// Largest number of datagrams read per poll.
const MAX_AT_ONCE: usize = 256;

/// Handle of a peer link's thread; dropping the handle stops and joins the thread.
pub struct PeerLink {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<LinkCounts>>,
}

/// Starts the peer link of a coupling: opens its socket in `directory` and starts the thread that transports the peer state. Not
/// real-time.
///
/// # Errors
/// [`PublishError`]; the run continues, and its end of the coupling requests no force.
pub fn start_peer_link(directory: &Directory, coupling: &str, line: Line) -> Result<PeerLink, PublishError> {
    let socket = PeerSocket::listen(directory, coupling)?;
    let stop = Arc::new(AtomicBool::new(false));
    let until = Arc::clone(&stop);
    let thread = std::thread::Builder::new().name("flotor-peer".to_owned());
    let thread = thread.spawn(move || run(socket, line, &until)).map_err(PublishError::Thread)?;
    Ok(PeerLink { stop, thread: Some(thread) })
}

impl PeerLink {
    /// Stops the thread, waits for its end and returns its counts of messages. Not real-time.
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
    let Line { outgoing, mut incoming, silence_ns } = line;
    let began = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    #[allow(clippy::cast_possible_truncation)] // in the year 2554
    let run = began as u64;
    let mut sent = 0;
    let mut pairing = Pairing::new(run, silence_ns);
    let since = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        if let Some((version, dispatch)) = outgoing.read()
            && version != sent
        {
            sent = version;
            socket.send(&pairing.address(&dispatch));
        }
        // Only the newest message of a poll counts. The limit bounds a flood; the next poll reads its rest.
        #[allow(clippy::cast_possible_truncation)] // in five hundred years
        let now_ns = since.elapsed().as_nanos() as u64;
        let mut newest = None;
        for _ in 0..MAX_AT_ONCE {
            match socket.receive() {
                Ok(None) => break,
                Ok(Some(dispatch)) => newest = pairing.take(dispatch, now_ns).or(newest),
                Err(_) => pairing.refuse(),
            }
        }
        newest.iter().for_each(|newest| incoming.publish(newest));
        std::thread::sleep(LOOK_PERIOD);
    }
    pairing.counts()
}
