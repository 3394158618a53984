//! Data feed of a running host: a reading thread, and the data received since the last frame.

use flotor_core::lock;
use flotor_core::trace::TickRecord;
use flotor_live::{
    Answer, Ask, ChangeMessage, Client, End, EndKind, Event, Greeting, LiveError, RequestClient,
};
use flotor_record::RunDescription;
use std::collections::VecDeque;
use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Largest number of buffered ticks; beyond it the oldest are dropped, because a hidden window reads no ticks.
const MOST_WAITING: usize = 32_768;
/// Largest number of buffered answers; with as many buffered changes, only the newest change of each parameter is buffered.
const MOST_ARRIVALS: usize = 1024;
/// Timeout of a read, after which the thread checks for its end.
const READ_WAIT: Duration = Duration::from_millis(200);
/// Time without a tick after which the data is stale.
pub const STALE_AFTER: Duration = Duration::from_millis(500);

/// Error text for a connection that ends without a message.
const GONE: &str = "The program that ran the loop has ended without a message: the program was killed or crashed, \
and its watchdog stops the device. Check the terminal, and start the run again";

/// State of the connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FeedState {
    /// The run continues.
    Running,
    /// The run has ended; the values are the reason and the kind of the end.
    Ended(String, EndKind),
    /// The connection was lost, or the host sent invalid data; the value is the error message.
    Lost(String),
}

/// Data received since the last call of [`Feed::arrivals`].
#[derive(Debug, Default)]
pub struct Arrivals {
    /// Tick records of all devices, in order.
    pub records: VecDeque<TickRecord>,
    /// Changes of parameters.
    pub changes: Vec<ChangeMessage>,
    /// Answers to requests.
    pub answers: Vec<Answer>,
}

#[derive(Debug)]
struct Waiting {
    arrivals: Arrivals,
    dropped_by_host: u64,
    dropped_here: u64,
    last_tick: Instant,
    state: FeedState,
}

/// Connection to a run, with its reading thread.
#[derive(Debug)]
pub struct Feed {
    waiting: Arc<Mutex<Waiting>>,
    is_over: Arc<AtomicBool>,
    request_client: RequestClient,
    /// Greeting of the host at the start of the connection.
    pub(crate) greeting: Greeting,
    /// Description of the run.
    pub(crate) run: RunDescription,
}

impl Feed {
    /// Starts a thread that reads from a client and calls `wake` on new data.
    ///
    /// # Errors
    /// [`LiveError::Connection`] if the host is gone or the thread cannot be started.
    pub fn start(mut client: Client, wake: impl Fn() + Send + 'static) -> Result<Self, LiveError> {
        let waiting = Arc::new(Mutex::new(Waiting {
            arrivals: Arrivals::default(),
            dropped_by_host: 0,
            dropped_here: 0,
            last_tick: Instant::now(),
            state: FeedState::Running,
        }));
        let is_over = Arc::new(AtomicBool::new(false));
        let (request_client, greeting, run) =
            (client.request_client(), client.greeting().clone(), client.run().clone());
        request_client.ask(Ask::Watch { every: every(run.rate_hz) })?;
        let (for_thread, over) = (Arc::clone(&waiting), Arc::clone(&is_over));
        std::thread::Builder::new().name("flotor-feed".to_owned()).spawn(move || {
            while !over.load(Ordering::Relaxed) {
                let next = client.next(READ_WAIT);
                let quiet = matches!(next, Ok(None));
                let goes_on = lock(&for_thread).apply(next);
                if !quiet {
                    wake();
                }
                if !goes_on {
                    return;
                }
            }
        })?;
        Ok(Self { waiting, is_over, request_client, greeting, run })
    }

    /// Returns the data received since the last call, and clears the buffer.
    #[must_use]
    pub fn arrivals(&self) -> Arrivals {
        std::mem::take(&mut lock(&self.waiting).arrivals)
    }

    /// Returns the state of the connection.
    #[must_use]
    pub fn state(&self) -> FeedState {
        lock(&self.waiting).state.clone()
    }

    /// Returns whether the run continues but no tick has arrived for [`STALE_AFTER`].
    #[must_use]
    pub fn is_stale(&self) -> bool {
        let waiting = lock(&self.waiting);
        waiting.state == FeedState::Running && waiting.last_tick.elapsed() > STALE_AFTER
    }

    /// Returns the number of ticks dropped by the host and by this buffer.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        let waiting = lock(&self.waiting);
        waiting.dropped_by_host + waiting.dropped_here
    }

    /// Sends a request to the host and returns the number of the request.
    ///
    /// # Errors
    /// [`LiveError::Connection`] if the host is gone.
    pub fn ask(&self, ask: Ask) -> Result<u64, LiveError> {
        self.request_client.ask(ask)
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

impl Waiting {
    /// Stores an event; returns true while more events may come.
    fn apply(&mut self, next: Result<Option<Event>, LiveError>) -> bool {
        let Arrivals { records: ticks, changes, answers } = &mut self.arrivals;
        match next {
            Ok(None) => {}
            Ok(Some(Event::Ticks { records, dropped })) => {
                self.dropped_by_host = dropped;
                self.last_tick = Instant::now();
                ticks.extend(records);
                while ticks.len() > MOST_WAITING {
                    ticks.pop_front();
                    self.dropped_here += 1;
                }
            }
            Ok(Some(Event::Change(change))) => {
                // The newest change of a parameter has the value in force: at the limit, remove an earlier change of the same parameter.
                if changes.len() >= MOST_ARRIVALS
                    && let Some(earliest) = changes.iter().position(|earlier| earlier.is_of_the_same(&change))
                {
                    changes.remove(earliest);
                }
                changes.push(change);
            }
            Ok(Some(Event::Answer(answer))) if answers.len() < MOST_ARRIVALS => answers.push(answer),
            Ok(Some(Event::Answer(_))) => {}
            Ok(Some(Event::End(End { words, kind }))) => self.state = FeedState::Ended(words, kind),
            Err(LiveError::Connection(cause)) if cause.kind() == ErrorKind::UnexpectedEof => {
                self.state = FeedState::Lost(GONE.to_owned());
            }
            Err(error) => self.state = FeedState::Lost(error.to_string()),
        }
        self.state == FeedState::Running
    }
}

/// Returns the decimation of ticks for pictures: at least a thousand ticks per second are read.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 100 Hz to 10 kHz
fn every(rate_hz: f64) -> u32 {
    (rate_hz / 1000.0).floor().max(1.0) as u32
}
