//! Connection of one client: a thread that writes pending frames, and a thread that reads requests.

use super::outbox::Outbox;
use super::threads::{join_until, thread};
use crate::platform::Stream;
use crate::{Answer, Frames, Kind, frame};
use std::io::{ErrorKind, Write};
use std::net::Shutdown;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Pause between two batches: a client draws at most a hundred frames a second.
const BATCH_PERIOD: Duration = Duration::from_millis(10);
/// Timeout of a write, after which the writer checks whether the run is over.
const WRITE_WAIT: Duration = Duration::from_millis(100);
/// Pause after each request: limits each client to a thousand requests a second, and delays only the sender.
const REQUEST_PERIOD: Duration = Duration::from_millis(1);

/// Grace period at the end of a run for a client to read the last frames, and for its pending requests to be answered.
pub(super) const PATIENCE: Duration = Duration::from_millis(500);

/// Handler of the requests of all clients, called in the reader threads.
pub(super) trait Handler: Send + Sync + 'static {
    /// Executes the request in a payload, and returns its answer.
    fn answer(&self, payload: &[u8], outbox: &Outbox) -> Answer;

    /// Handles the end of a client's requests.
    fn on_end(&self);
}

pub(super) struct Watcher {
    pub(super) outbox: Arc<Outbox>,
    /// Connection, shared with both threads: one descriptor for each client.
    stream: Arc<Stream>,
    writer: JoinHandle<()>,
    reader: JoinHandle<()>,
    /// Time of the connection or the last request, ms since the publication began.
    last_request_ms: Arc<AtomicU64>,
}

impl Watcher {
    /// Starts the threads of a connection, for a publication that began at `since`; `None` if the system cannot start a thread.
    pub(super) fn start(
        stream: Stream,
        outbox: Arc<Outbox>,
        handler: Arc<impl Handler>,
        since: Instant,
    ) -> Option<Self> {
        stream.set_write_timeout(Some(WRITE_WAIT)).ok()?;
        let stream = Arc::new(stream);
        let (to_write, to_read) = (Arc::clone(&stream), Arc::clone(&stream));
        let (for_writer, for_reader) = (Arc::clone(&outbox), Arc::clone(&outbox));
        let writer = thread("flotor-live-out").spawn(move || write(&to_write, &for_writer)).ok()?;
        let last_request_ms = Arc::new(AtomicU64::new(elapsed_ms(since)));
        let last_request = Arc::clone(&last_request_ms);
        let reader = thread("flotor-live-in").spawn(move || {
            read(&to_read, &for_reader, &*handler, since, &last_request);
            // The client has closed the connection or sends malformed frames: the writer ends, too.
            for_reader.want_no_ticks();
            for_reader.close();
            handler.on_end();
        });
        let reader = reader.inspect_err(|_| outbox.close()).ok()?;
        Some(Self { outbox, stream, writer, reader, last_request_ms })
    }

    /// Returns true if the client has closed its end, or the run is over.
    pub(super) fn is_gone(&self) -> bool {
        self.outbox.is_closed()
    }

    /// Returns the time of the connection or the last request, ms since the publication began.
    pub(super) fn last_request_ms(&self) -> u64 {
        self.last_request_ms.load(Ordering::Relaxed)
    }

    /// Stops reading requests; the threads end once the requests that have already arrived are answered.
    pub(super) fn evict(&self) {
        let _ = self.stream.shutdown(Shutdown::Read);
    }

    /// Returns true if both threads have ended.
    pub(super) fn has_ended(&self) -> bool {
        self.writer.is_finished() && self.reader.is_finished()
    }

    /// Waits for both threads to end.
    pub(super) fn join(self) {
        let _ = self.writer.join();
        let _ = self.reader.join();
    }

    /// Waits until pending frames are sent (the client has [`PATIENCE`] to read them) or until the deadline, then closes the connection.
    pub(super) fn finish(self, until: Instant) {
        join_until(self.writer, until);
        let _ = self.stream.shutdown(Shutdown::Both);
        // The reader may be executing a request that takes a while.
        join_until(self.reader, until.min(Instant::now() + PATIENCE));
    }
}

/// Writes frames until the outbox is closed and empty, or the client has closed its end.
fn write(stream: &Stream, outbox: &Outbox) {
    while let Some(bytes) = outbox.take() {
        if !write_whole(stream, &bytes, outbox) {
            break;
        }
        outbox.pause(BATCH_PERIOD);
    }
    outbox.want_no_ticks();
    // The client sees the end of the stream after all frames.
    let _ = stream.shutdown(Shutdown::Write);
}

/// Writes all bytes and returns true; false if the client is gone. Waits for a client that does not read as long as the run lasts,
/// and for [`PATIENCE`] after its end.
fn write_whole(mut stream: &Stream, mut bytes: &[u8], outbox: &Outbox) -> bool {
    let mut closed_since: Option<Instant> = None;
    while !bytes.is_empty() {
        match stream.write(bytes) {
            Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                if outbox.is_closed() && closed_since.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
                    return false;
                }
            }
            Err(_) => return false,
        }
    }
    true
}

/// Answers requests until the client closes the connection.
fn read(
    mut stream: &Stream,
    outbox: &Outbox,
    handler: &impl Handler,
    since: Instant,
    last_request_ms: &AtomicU64,
) {
    let mut frames = Frames::default();
    loop {
        match frames.fill(&mut stream) {
            Ok(0) => return,
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return,
        }
        loop {
            match frames.take() {
                Ok(Some((Kind::Request, payload))) => {
                    last_request_ms.store(elapsed_ms(since), Ordering::Relaxed);
                    let answer = handler.answer(payload, outbox);
                    if let Ok(payload) = serde_json::to_vec(&answer) {
                        outbox.push(frame(Kind::Answer, &payload));
                    }
                    std::thread::sleep(REQUEST_PERIOD);
                }
                Ok(Some(_)) => {}
                Ok(None) => break,
                Err(_) => return,
            }
        }
    }
}

fn elapsed_ms(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX)
}
