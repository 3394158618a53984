//! One watcher: a thread that writes what waits, a thread that reads what is asked for.

use super::outbox::Outbox;
use super::{PATIENCE, Shared, join_until, thread};
use crate::platform::Stream;
use crate::{Answer, Ask, Frames, Kind, RefusalCause, Request, frame};
use std::io::{ErrorKind, Write};
use std::net::Shutdown;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Pause between two batches: a watcher draws at most a hundred pictures a second.
const BATCH_PERIOD: Duration = Duration::from_millis(10);
/// How long a write may wait before the writer looks whether the run is over.
const WRITE_WAIT: Duration = Duration::from_millis(100);
/// Pause after each request: a flood is throttled to a thousand a second and holds up only its sender.
const REQUEST_PERIOD: Duration = Duration::from_millis(1);

pub(super) struct Watcher {
    pub(super) outbox: Arc<Outbox>,
    /// Shared with its threads: one descriptor for each client.
    stream: Arc<Stream>,
    writer: JoinHandle<()>,
    reader: JoinHandle<()>,
    /// When it came or asked for something last, ms.
    heard_ms: Arc<AtomicU64>,
}

impl Watcher {
    /// Serves a connection; `None` if there is no thread to be had.
    pub(super) fn start(stream: Stream, outbox: Arc<Outbox>, shared: &Arc<Shared>) -> Option<Self> {
        stream.set_write_timeout(Some(WRITE_WAIT)).ok()?;
        let stream = Arc::new(stream);
        let (to_write, to_read) = (Arc::clone(&stream), Arc::clone(&stream));
        let (for_writer, for_reader, of_run) = (Arc::clone(&outbox), Arc::clone(&outbox), Arc::clone(shared));
        let writer = thread("flotor-live-out").spawn(move || write(&to_write, &for_writer)).ok()?;
        let heard_ms = Arc::new(AtomicU64::new(shared.now_ms()));
        let heard = Arc::clone(&heard_ms);
        let reader = thread("flotor-live-in").spawn(move || {
            read(&to_read, &for_reader, &of_run, &heard);
            // The watcher has gone or talks nonsense: the writer ends, too.
            for_reader.want_no_ticks();
            for_reader.close();
            of_run.count(&of_run.watchers());
        });
        match reader {
            Ok(reader) => Some(Self { outbox, stream, writer, reader, heard_ms }),
            Err(_) => {
                outbox.close();
                None
            }
        }
    }

    /// True if nobody is at the other end any more.
    pub(super) fn is_gone(&self) -> bool {
        self.outbox.is_closed()
    }

    /// When it came or asked for something last, ms since the publication began.
    pub(super) fn heard_ms(&self) -> u64 {
        self.heard_ms.load(Ordering::Relaxed)
    }

    /// Takes no further request; its threads end by themselves, after those that have arrived are answered.
    pub(super) fn evict(&self) {
        let _ = self.stream.shutdown(Shutdown::Read);
    }

    /// Whether both threads are at their end.
    pub(super) fn has_ended(&self) -> bool {
        self.writer.is_finished() && self.reader.is_finished()
    }

    /// Waits for both threads.
    pub(super) fn join(self) {
        let _ = self.writer.join();
        let _ = self.reader.join();
    }

    /// Sends what waits to a client that reads it within [`PATIENCE`], and closes the connection.
    pub(super) fn finish(self, until: Instant) {
        join_until(self.writer, until);
        let _ = self.stream.shutdown(Shutdown::Both);
        // It may be at a request whose answer takes its time.
        join_until(self.reader, until.min(Instant::now() + PATIENCE));
    }
}

/// Writes until the outbox is closed and empty, or nobody reads.
fn write(stream: &Stream, outbox: &Outbox) {
    while let Some(bytes) = outbox.take() {
        if !write_whole(stream, &bytes, outbox) {
            break;
        }
        outbox.pause(BATCH_PERIOD);
    }
    outbox.want_no_ticks();
    // A reader sees the end when it has read all of it.
    let _ = stream.shutdown(Shutdown::Write);
}

/// True when all is written; a frozen watcher is waited for as long as the run lasts, and a little longer.
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

/// Does what is asked for until the watcher goes.
fn read(mut stream: &Stream, outbox: &Outbox, shared: &Shared, heard_ms: &AtomicU64) {
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
                    heard_ms.store(shared.now_ms(), Ordering::Relaxed);
                    let answer = answer(payload, outbox, shared);
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

fn answer(payload: &[u8], outbox: &Outbox, shared: &Shared) -> Answer {
    let (number, done) = match Request::read(payload) {
        Ok(Request { number, ask }) => (number, carry_out(ask, outbox, shared)),
        Err((number, error)) => {
            (number, Err((RefusalCause::Request, format!("no request this host knows: {error}"))))
        }
    };
    let (cause, refused) = done.err().map(|(cause, words)| (cause, Some(words))).unwrap_or_default();
    Answer { number, refused, cause }
}

fn carry_out(ask: Ask, outbox: &Outbox, shared: &Shared) -> Result<(), (RefusalCause, String)> {
    match ask {
        Ask::Watch { every } => {
            shared.admit(outbox, every).map_err(|refused| (RefusalCause::Other, refused))?
        }
        Ask::LookAway => {
            outbox.want_no_ticks();
            shared.count(&shared.watchers());
        }
        asked => shared.host.serve(asked)?,
    }
    Ok(())
}
