//! The watching side.

use crate::frame::{Frames, Kind, LongFrame, frame, ticks_from_payload};
use crate::message::{Answer, Ask, ChangeMessage, End, Greeting, Request};
use crate::platform::{Stream, connect};
use crate::{Directory, Found, PROTOCOL};
use flotor_core::trace::TickRecord;
use flotor_record::RunDescription;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a host may take to say who it is.
const GREETING_WAIT: Duration = Duration::from_secs(2);
/// How long a request may take to leave this process.
const ASK_WAIT: Duration = Duration::from_secs(1);

/// Why a run cannot be watched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// Nothing runs.
    #[error("no running session: start one with `flotor run` (searched in {})", path.display())]
    NoRun {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// Others run, not the process that was named.
    #[error("process {process} runs no session; running: {}", running.join(", "))]
    OtherRuns {
        /// The process that was named.
        process: u32,
        /// Process and title of those that run.
        running: Vec<String>,
    },
    /// The connection broke.
    #[error("the host does not answer: {0}; is the run over?")]
    Connection(#[from] io::Error),
    /// The host speaks something else.
    #[error("the host speaks protocol {host}, this program {PROTOCOL}; use both from one build")]
    Protocol {
        /// What the host speaks.
        host: u32,
    },
    /// What the host says makes no sense.
    #[error("malformed message from the host: {0}; use both from one build")]
    Garbled(String),
}

impl From<LongFrame> for LiveError {
    fn from(error: LongFrame) -> Self {
        Self::Garbled(error.to_string())
    }
}

/// What a run tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Ticks, in order.
    Ticks {
        /// The records.
        records: Vec<TickRecord>,
        /// How many found no room on the way, since the beginning.
        dropped: u64,
    },
    /// A parameter changed.
    Change(ChangeMessage),
    /// A request was answered.
    Answer(Answer),
    /// The run is over. Nothing follows.
    End(End),
}

/// A run being watched.
#[derive(Debug)]
pub struct Client {
    stream: Stream,
    frames: Frames,
    asker: Asker,
    greeting: Greeting,
    run: RunDescription,
}

/// Asks a run for something, from any thread; clone it freely.
#[derive(Clone, Debug)]
pub struct Asker {
    stream: Arc<Mutex<Stream>>,
    number: Arc<AtomicU64>,
}

impl Client {
    /// Watches the newest run that answers.
    ///
    /// # Errors
    /// [`LiveError::NoRun`], or what is wrong with the newest run if none answers.
    pub fn find(directory: &Directory) -> Result<Self, LiveError> {
        Self::first_of(directory, directory.runs())
    }

    /// Watches the run of a process.
    ///
    /// # Errors
    /// As [`Client::find`]; [`LiveError::OtherRuns`] if only other processes run.
    pub fn of_process(directory: &Directory, process: u32) -> Result<Self, LiveError> {
        let (runs, others): (Vec<_>, Vec<_>) =
            directory.runs().into_iter().partition(|run| run.process == process);
        if runs.is_empty() && !others.is_empty() {
            let other = |run: &Found| match Self::connect(&run.path) {
                Ok(client) => format!("{} \"{}\"", run.process, client.greeting.title),
                Err(_) => run.process.to_string(),
            };
            return Err(LiveError::OtherRuns { process, running: others.iter().map(other).collect() });
        }
        Self::first_of(directory, runs)
    }

    fn first_of(directory: &Directory, runs: Vec<Found>) -> Result<Self, LiveError> {
        let mut first = None;
        for run in runs {
            match Self::connect(&run.path) {
                Ok(client) => return Ok(client),
                Err(error) => first = first.or(Some(error)),
            }
        }
        Err(first.unwrap_or_else(|| LiveError::NoRun { path: directory.path().to_path_buf() }))
    }

    /// Watches the run behind a socket. Nothing comes before [`Ask::Watch`].
    ///
    /// # Errors
    /// [`LiveError`].
    pub fn connect(path: &Path) -> Result<Self, LiveError> {
        let mut stream = connect(path)?;
        let mut frames = Frames::default();
        let until = Instant::now() + GREETING_WAIT;
        let greeting = read_frame(&mut stream, &mut frames, until, |kind, payload| {
            (kind == Kind::Greeting).then(|| json::<Greeting>(payload))
        })?;
        let greeting = greeting.ok_or_else(silent)??;
        if greeting.protocol != PROTOCOL {
            return Err(LiveError::Protocol { host: greeting.protocol });
        }
        let run = read_frame(&mut stream, &mut frames, until, |kind, payload| {
            (kind == Kind::Run).then(|| RunDescription::from_bytes(payload))
        })?;
        let run = run.ok_or_else(silent)?.map_err(|error| LiveError::Garbled(error.to_string()))?;
        let requests = stream.try_clone()?;
        requests.set_write_timeout(Some(ASK_WAIT))?;
        let asker = Asker { stream: Arc::new(Mutex::new(requests)), number: Arc::default() };
        Ok(Self { stream, frames, asker, greeting, run })
    }

    /// What the host said of itself.
    #[must_use]
    pub fn greeting(&self) -> &Greeting {
        &self.greeting
    }

    /// How the run was set up.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// The way to ask for something.
    #[must_use]
    pub fn asker(&self) -> Asker {
        self.asker.clone()
    }

    /// What comes next; nothing if nothing comes in this time.
    ///
    /// # Errors
    /// [`LiveError`]: the host is gone, or not understood.
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
            Kind::Greeting | Kind::Run | Kind::Request | Kind::Unknown(_) => None,
        })?;
        event.transpose()
    }
}

impl Asker {
    /// Sends a request; the number its answer will carry.
    ///
    /// # Errors
    /// [`LiveError::Connection`]: the host is gone, or takes nothing in.
    pub fn ask(&self, ask: Ask) -> Result<u64, LiveError> {
        let number = self.number.fetch_add(1, Ordering::Relaxed);
        let request = serde_json::to_vec(&Request { number, ask }).map_err(io::Error::from)?;
        let mut stream = self.stream.lock().unwrap_or_else(PoisonError::into_inner);
        stream.write_all(&frame(Kind::Request, &request))?;
        Ok(number)
    }
}

/// Reads until a frame is of use, or the time is over.
fn read_frame<T>(
    stream: &mut Stream,
    frames: &mut Frames,
    until: Instant,
    mut use_of: impl FnMut(Kind, &[u8]) -> Option<T>,
) -> Result<Option<T>, LiveError> {
    /// The system takes no time-out of zero.
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
    serde_json::from_slice(payload).map_err(|error| LiveError::Garbled(error.to_string()))
}

fn silent() -> LiveError {
    io::Error::from(ErrorKind::TimedOut).into()
}
