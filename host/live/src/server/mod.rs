//! Server: lets other programs on this machine observe a run and request changes.
//!
//! ```text
//!  Publication::observe -> outbox of each watcher -> its writer thread -> socket -> watcher
//!  Serve::serve         <-                           its reader thread <- socket <- watcher
//! ```
//!
//! The caller never waits for a client: a full outbox drops new ticks, which it counts, and new answers, but never the newest
//! change of a parameter. Without watching clients, a tick costs one atomic load. Not real-time.

mod outbox;
mod threads;
mod watcher;

use crate::platform::{Listening, Stream, has_left};
use crate::{
    Answer, Ask, Directory, DirectoryError, End, EndKind, Greeting, Kind, Listener, RefusalCause, Request,
    frame,
};
use flotor_core::demand::ObserverDemand;
use flotor_core::trace::TickRecord;
use flotor_core::{Change, lock};
use flotor_hal::Demand;
use flotor_record::RunDescription;
use outbox::Outbox;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use threads::{join_until, thread};
use watcher::{Handler, PATIENCE, Watcher};

/// Maximum number of clients that watch one run: each costs two threads and a queue.
const MAX_WATCHERS: usize = 16;
/// Maximum number of connections. Some of them do not watch: the one without a request for longest is closed in favour of a new
/// connection, so that a client can always connect for an emergency stop.
const MAX_CONNECTIONS: usize = MAX_WATCHERS + 4;
/// Maximum number of further connections whose threads are ending.
const MAX_CLOSING: usize = MAX_CONNECTIONS / 2;
/// Timeout for the end of all connections together when the publication is dropped.
const END_WAIT: Duration = Duration::from_millis(1000);
/// Pause after a connection that failed for lack of resources (mostly descriptors), and longest wait for threads to end.
const BREATH: Duration = Duration::from_millis(10);

/// Reason why a run cannot be published to other programs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PublishError {
    /// The socket cannot be created.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// A thread cannot be started.
    #[error("cannot start a thread: {0}; end other programs of this user")]
    Thread(#[from] io::Error),
}

/// Handler of the clients' requests: the host itself, or a proxy that forwards requests.
pub trait Serve: Send + Sync {
    /// Executes a request, or forwards it; called in the thread of the client's connection, so that only this client waits.
    /// [`Ask::Watch`] and [`Ask::Unwatch`] are handled by the server and never passed.
    ///
    /// # Errors
    /// Kind of reason for the rejection, and the human-readable reason.
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)>;
}

/// Publication of a run to other programs. Dropping it closes all connections, after at most about 1.5 s.
pub struct Publication {
    shared: Arc<Shared>,
    acceptor: Option<JoinHandle<()>>,
    listener: Listener,
}

/// State shared by all threads of a publication.
struct Shared {
    watchers: Mutex<Vec<Watcher>>,
    /// Clients that have disconnected or were evicted, whose threads have not ended yet.
    closing: Mutex<Vec<Watcher>>,
    /// Number of watching clients: if it is zero, a tick reads only this number.
    watching: AtomicUsize,
    greeting: Mutex<Greeting>,
    run: Vec<u8>,
    host: Arc<dyn Serve>,
    /// Demand for model outputs, to which a watching client adds all outputs.
    demand: ObserverDemand,
    started: Instant,
}

impl Publication {
    /// Publishes a run on a new socket in `directory`, with requests handled by `host`. While a client watches, all outputs of the
    /// models are requested at `demand`.
    ///
    /// # Errors
    /// If the socket or a thread cannot be created; the run can continue without observers.
    pub fn open(
        directory: &Directory,
        greeting: Greeting,
        run: &RunDescription,
        host: Arc<dyn Serve>,
        demand: ObserverDemand,
    ) -> Result<Self, PublishError> {
        let listener = directory.listen()?;
        let shared = Arc::new(Shared {
            watchers: Mutex::default(),
            closing: Mutex::default(),
            watching: AtomicUsize::new(0),
            greeting: Mutex::new(greeting),
            run: run.to_bytes(),
            host,
            demand,
            started: Instant::now(),
        });
        let (socket, for_acceptor) = (Arc::clone(&listener.socket), Arc::clone(&shared));
        let acceptor = thread("flotor-live").spawn(move || accept(&socket, &for_acceptor))?;
        Ok(Self { shared, acceptor: Some(acceptor), listener })
    }

    /// Returns the path of the socket file that clients connect to.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.listener.path()
    }

    /// Sends a tick record to the watching clients; ticks have to come in order. Does not wait for clients.
    pub fn observe(&self, record: &TickRecord) {
        if self.shared.watching.load(Ordering::Relaxed) == 0 {
            return;
        }
        for watcher in self.shared.watchers().iter() {
            watcher.outbox.tick(record);
        }
    }

    /// Sends a change to all clients, and updates the greeting; to be called before the first tick that uses the change. Does not
    /// wait for clients.
    pub fn change(&self, change: &Change) {
        lock(&self.shared.greeting).keep(change);
        let Ok(payload) = serde_json::to_vec(change) else { return };
        let (change, bytes) = (Arc::new(change.clone()), frame(Kind::Change, &payload));
        for watcher in self.shared.watchers().iter() {
            watcher.outbox.change(Arc::clone(&change), bytes.clone());
        }
    }

    /// Sends the outcome of the run to all clients, and ends the publication: no client can connect afterwards.
    pub fn end(self, words: &str, kind: EndKind) {
        let Ok(payload) = serde_json::to_vec(&End { words: words.to_owned(), kind }) else { return };
        let bytes = frame(Kind::End, &payload);
        self.shared.watchers().iter().for_each(|watcher| watcher.outbox.last(bytes.clone()));
    }
}

impl Drop for Publication {
    fn drop(&mut self) {
        self.listener.socket.close();
        if let Some(acceptor) = self.acceptor.take() {
            join_until(acceptor, Instant::now() + PATIENCE);
        }
        let watchers = std::mem::take(&mut *self.shared.watchers());
        watchers.iter().for_each(|watcher| watcher.outbox.close());
        let until = Instant::now() + END_WAIT;
        watchers.into_iter().for_each(|watcher| watcher.finish(until));
    }
}

impl Shared {
    fn watchers(&self) -> MutexGuard<'_, Vec<Watcher>> {
        lock(&self.watchers)
    }

    /// Joins the threads that have ended; if too many are ending, waits for at most [`BREATH`]. Returns true if there is room for
    /// another connection to close.
    fn has_room_to_close(&self) -> bool {
        let until = Instant::now() + BREATH;
        let mut closing = lock(&self.closing);
        loop {
            closing.extract_if(.., |watcher| watcher.has_ended()).for_each(Watcher::join);
            if closing.len() < MAX_CLOSING || Instant::now() >= until {
                return closing.len() < MAX_CLOSING;
            }
            std::thread::sleep(BREATH / 100);
        }
    }

    /// Stores a client whose threads have not ended yet.
    fn close(&self, watcher: Watcher) {
        lock(&self.closing).push(watcher);
    }

    /// Starts sending ticks to a client, or changes the interval; an error if too many clients watch.
    fn admit(&self, outbox: &Outbox, every: u32) -> Result<(), (RefusalCause, String)> {
        let watchers = self.watchers();
        if !outbox.wants_ticks() && self.watching.load(Ordering::Relaxed) >= MAX_WATCHERS {
            let words =
                format!("{MAX_WATCHERS} clients watch the run already, the maximum; close one of them");
            return Err((RefusalCause::Other, words));
        }
        outbox.want_ticks(every.max(1), self.demand.request(Demand::ALL));
        self.count(&watchers);
        Ok(())
    }

    fn carry_out(&self, ask: Ask, outbox: &Outbox) -> Result<(), (RefusalCause, String)> {
        match ask {
            Ask::Watch { every } => self.admit(outbox, every)?,
            Ask::Unwatch => {
                outbox.want_no_ticks();
                self.count(&self.watchers());
            }
            asked => self.host.serve(asked)?,
        }
        Ok(())
    }

    /// Updates the number of watching clients, after a client has started or stopped watching, or disconnected.
    fn count(&self, watchers: &[Watcher]) {
        let watching = watchers.iter().filter(|watcher| watcher.outbox.wants_ticks()).count();
        self.watching.store(watching, Ordering::Relaxed);
    }
}

impl Handler for Shared {
    fn answer(&self, payload: &[u8], outbox: &Outbox) -> Answer {
        let (number, done) = match Request::read(payload) {
            Ok(Request { number, ask }) => (number, self.carry_out(ask, outbox)),
            Err((number, error)) => {
                let words =
                    format!("unknown or malformed request: {error}; use both programs from one build");
                (number, Err((RefusalCause::Request, words)))
            }
        };
        let (cause, refused) = done.err().map(|(cause, words)| (cause, Some(words))).unwrap_or_default();
        Answer { number, refused, cause }
    }

    fn on_end(&self) {
        self.count(&self.watchers());
    }
}

/// Accepts clients until the run is over.
fn accept(socket: &Listening, shared: &Arc<Shared>) {
    loop {
        match socket.accept() {
            Ok(None) => return,
            Ok(Some(stream)) => welcome(stream, shared),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => {
                // An idle client may occupy the missing descriptor.
                if shared.has_room_to_close() {
                    evict_longest_silent(&mut shared.watchers(), shared);
                }
                std::thread::sleep(BREATH);
            }
        }
    }
}

/// Serves a connection, or closes it if no thread can start or there are too many connections.
fn welcome(stream: Stream, shared: &Arc<Shared>) {
    if has_left(&stream) || !shared.has_room_to_close() {
        return;
    }
    let mut watchers = shared.watchers();
    watchers.extract_if(.., |watcher| watcher.is_gone()).for_each(|watcher| shared.close(watcher));
    shared.count(&watchers);
    if watchers.len() >= MAX_CONNECTIONS && !evict_longest_silent(&mut watchers, shared) {
        return;
    }
    let outbox = Arc::new(Outbox::default());
    let Ok(greeting) = serde_json::to_vec(&*lock(&shared.greeting)) else { return };
    outbox.push(frame(Kind::Greeting, &greeting));
    outbox.push(frame(Kind::Run, &shared.run));
    // With the list locked, so that no change is sent between greeting and list.
    watchers.extend(Watcher::start(stream, outbox, Arc::clone(shared), shared.started));
}

/// Closes the connection of the client that does not watch and has sent no request for longest; returns false if all clients watch.
fn evict_longest_silent(watchers: &mut Vec<Watcher>, shared: &Shared) -> bool {
    let idle = watchers.iter().enumerate().filter(|(_, watcher)| !watcher.outbox.wants_ticks());
    let longest = idle.min_by_key(|(_, watcher)| watcher.last_request_ms()).map(|(place, _)| place);
    let evicted = longest.map(|place| watchers.remove(place));
    evicted.inspect(Watcher::evict).map(|watcher| shared.close(watcher)).is_some()
}

#[cfg(test)]
mod tests;
