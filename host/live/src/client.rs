//! Client of a running host: connection, events and requests.

use crate::frame::{Frames, Kind, LongFrame, frame, ticks_from_payload};
use crate::message::{Answer, Ask, End, Greeting, Request};
use crate::platform::{Stream, connect};
use crate::{Directory, FoundRun, PROTOCOL};
use flotor_core::trace::TickRecord;
use flotor_core::{Change, lock};
use flotor_record::RunDescription;
use std::io::{self, ErrorKind, Write};
use std::net::Shutdown;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Timeout for the greeting and the run description of a host.
const GREETING_WAIT: Duration = Duration::from_secs(2);
/// Timeout for sending a request.
const ASK_WAIT: Duration = Duration::from_secs(1);

/// Reason why a client cannot observe a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// No session is running in the folder searched.
    #[error("no running session: start one with `flotor run` (searched in {})", .0.display())]
    NoRun(PathBuf),
    /// Sessions are running, but none in the given process.
    #[error("process {process} runs no session; give the process of a running session: {}", running.join(", "))]
    OtherRuns {
        /// Process id that was given.
        process: u32,
        /// Process id and title of each running session; the id alone if the host does not reply.
        running: Vec<String>,
    },
    /// The connection failed, was closed, or timed out.
    #[error("the host does not reply: {0}; check whether the run has ended")]
    Connection(#[from] io::Error),
    /// The host uses another protocol version.
    #[error("the host uses protocol version {0}, this program version {PROTOCOL}; use both from one build")]
    Protocol(u32),
    /// A message of the host is malformed.
    #[error("malformed message from the host: {0}; use the host and this program from one build")]
    Malformed(String),
}

impl From<LongFrame> for LiveError {
    fn from(error: LongFrame) -> Self {
        Self::Malformed(error.to_string())
    }
}

/// Message received from a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Batch of tick records.
    Ticks {
        /// Records in the order of the ticks.
        records: Vec<TickRecord>,
        /// Number of records dropped since the connection because the client's queue was full.
        dropped: u64,
    },
    /// Change of a parameter, a weight or a plugin, applied or rejected.
    Change(Change),
    /// Answer to a request.
    Answer(Answer),
    /// End of the run, the last event.
    End(End),
}

/// Connection to a run, which receives its events.
#[derive(Debug)]
pub struct Client {
    stream: Stream,
    frames: Frames,
    request_client: RequestClient,
    greeting: Greeting,
    run: RunDescription,
}

/// Sender of requests to a run, usable from any thread; clones share the connection.
#[derive(Clone, Debug)]
pub struct RequestClient {
    stream: Arc<Mutex<Stream>>,
    number: Arc<AtomicU64>,
}

impl Client {
    /// Connects to the newest run whose host replies. Not real-time.
    ///
    /// # Errors
    /// [`LiveError::NoRun`], or the error of the newest run if no host replies.
    pub fn find(directory: &Directory) -> Result<Self, LiveError> {
        Self::first_of(directory, directory.runs())
    }

    /// Connects to the newest run of the process with id `process`. Not real-time.
    ///
    /// # Errors
    /// The errors of [`Client::find`]; [`LiveError::OtherRuns`] if only other processes run sessions.
    pub fn of_process(directory: &Directory, process: u32) -> Result<Self, LiveError> {
        let (runs, others): (Vec<_>, Vec<_>) =
            directory.runs().into_iter().partition(|run| run.process == process);
        if runs.is_empty() && !others.is_empty() {
            let other = |run: &FoundRun| match Self::connect(&run.path) {
                Ok(client) => format!("{} \"{}\"", run.process, client.greeting.title),
                Err(_) => run.process.to_string(),
            };
            return Err(LiveError::OtherRuns { process, running: others.iter().map(other).collect() });
        }
        Self::first_of(directory, runs)
    }

    fn first_of(directory: &Directory, runs: Vec<FoundRun>) -> Result<Self, LiveError> {
        let mut first = None;
        for run in runs {
            match Self::connect(&run.path) {
                Ok(client) => return Ok(client),
                Err(error) => first = first.or(Some(error)),
            }
        }
        Err(first.unwrap_or_else(|| LiveError::NoRun(directory.path().to_path_buf())))
    }

    /// Connects to the run of a socket file, and waits up to 2 s for greeting and description. Ticks arrive only after
    /// [`Ask::Watch`]. Not real-time.
    ///
    /// # Errors
    /// If the connection fails or times out, a message is malformed, or the host uses another protocol version.
    pub fn connect(path: &Path) -> Result<Self, LiveError> {
        let mut stream = connect(path)?;
        let mut frames = Frames::default();
        let until = Instant::now() + GREETING_WAIT;
        let greeting = read_frame(&mut stream, &mut frames, until, |kind, payload| {
            (kind == Kind::Greeting).then(|| json::<Greeting>(payload))
        })?;
        let greeting = greeting.ok_or_else(silent)??;
        if greeting.protocol != PROTOCOL {
            return Err(LiveError::Protocol(greeting.protocol));
        }
        let run = read_frame(&mut stream, &mut frames, until, |kind, payload| {
            (kind == Kind::Run).then(|| RunDescription::from_bytes(payload))
        })?;
        let run = run.ok_or_else(silent)?.map_err(|error| LiveError::Malformed(error.to_string()))?;
        let requests = stream.try_clone()?;
        requests.set_write_timeout(Some(ASK_WAIT))?;
        let request_client = RequestClient { stream: Arc::new(Mutex::new(requests)), number: Arc::default() };
        Ok(Self { stream, frames, request_client, greeting, run })
    }

    /// Returns the greeting of the host: plugins with their parameters when the client connected, and limits.
    #[must_use]
    pub fn greeting(&self) -> &Greeting {
        &self.greeting
    }

    /// Returns the description of the run, as in a recording.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// Returns a sender of requests over this connection.
    #[must_use]
    pub fn request_client(&self) -> RequestClient {
        self.request_client.clone()
    }

    /// Waits for the next event; `None` on timeout.
    ///
    /// # Errors
    /// If the connection is closed, or a message is malformed.
    pub fn next(&mut self, timeout: Duration) -> Result<Option<Event>, LiveError> {
        let until = Instant::now() + timeout;
        let event = read_frame(&mut self.stream, &mut self.frames, until, |kind, payload| match kind {
            Kind::Ticks => {
                let (dropped, records) = ticks_from_payload(payload);
                Some(Ok(Event::Ticks { records, dropped }))
            }
            Kind::Change => Some(json(payload).map(Event::Change)),
            Kind::Answer => Some(json(payload).map(Event::Answer)),
            Kind::End => Some(json(payload).map(Event::End)),
            Kind::Greeting | Kind::Run | Kind::Request => None,
        })?;
        event.transpose()
    }
}

impl RequestClient {
    /// Sends a request; returns the number that the [`Answer`] will contain. Does not wait for the answer.
    ///
    /// # Errors
    /// [`LiveError::Connection`] if the host has closed the connection, or does not read the request within 1 s: the connection then
    /// ends, because the host would read the rest of this request as the start of the next one.
    pub fn ask(&self, ask: Ask) -> Result<u64, LiveError> {
        let number = self.number.fetch_add(1, Ordering::Relaxed);
        let request = serde_json::to_vec(&Request { number, ask }).map_err(io::Error::from)?;
        let mut stream = lock(&self.stream);
        let written = stream.write_all(&frame(Kind::Request, &request));
        if written.is_err() {
            let _ = stream.shutdown(Shutdown::Both);
        }
        written?;
        Ok(number)
    }
}

/// Reads frames until `use_of` returns a result for one; `None` at the deadline `until`.
fn read_frame<T>(
    stream: &mut Stream,
    frames: &mut Frames,
    until: Instant,
    mut use_of: impl FnMut(Kind, &[u8]) -> Option<T>,
) -> Result<Option<T>, LiveError> {
    /// Shortest timeout that the system accepts: zero is invalid.
    const SHORTEST: Duration = Duration::from_micros(100);
    loop {
        while let Some((kind, payload)) = frames.take()? {
            if let Some(used) = use_of(kind, payload) {
                return Ok(Some(used));
            }
        }
        let left = until.saturating_duration_since(Instant::now());
        stream.set_read_timeout(Some(left.max(SHORTEST)))?;
        match frames.fill(stream) {
            Ok(0) => return Err(io::Error::from(ErrorKind::UnexpectedEof).into()),
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                if left.is_zero() {
                    return Ok(None);
                }
            }
            Err(error) => return Err(error.into()),
        }
    }
}

fn json<T: serde::de::DeserializeOwned>(payload: &[u8]) -> Result<T, LiveError> {
    serde_json::from_slice(payload).map_err(|error| LiveError::Malformed(error.to_string()))
}

fn silent() -> LiveError {
    io::Error::from(ErrorKind::TimedOut).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::platform::Listening;

    #[test]
    fn a_host_that_does_not_read_gets_whole_requests_and_then_the_end_of_the_connection() {
        let folder = tempfile::tempdir().expect("a folder for the socket");
        let path = folder.path().join("host");
        let listening = Listening::bind(&path).expect("a free path");
        let client = connect(&path).expect("a host that listens");
        let mut host = listening.accept().expect("a client").expect("an open socket");
        client.set_write_timeout(Some(Duration::from_millis(10))).expect("a time-out is legal");
        let client = RequestClient { stream: Arc::new(Mutex::new(client)), number: Arc::default() };
        let asked = (0..1_000_000).take_while(|_| client.ask(Ask::EmergencyStop).is_ok()).count();

        let (mut frames, mut read) = (Frames::default(), 0);
        loop {
            while let Some((kind, _)) = frames.take().expect("whole frames") {
                assert_eq!(kind, Kind::Request);
                read += 1;
            }
            if frames.fill(&mut host).expect("the rest of the connection") == 0 {
                break;
            }
        }
        assert!(asked > 0 && read == asked, "{read} of {asked}");
        client.ask(Ask::EmergencyStop).expect_err("the connection has ended");
    }
}
