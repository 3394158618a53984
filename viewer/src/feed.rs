//! A running host, as the window sees it: a thread that reads, and what it has read since the last picture.

use flotor_core::trace::TickRecord;
use flotor_live::{Answer, Ask, Asker, ChangeMessage, Client, End, EndKind, Event, Greeting, LiveError};
use flotor_record::RunDescription;
use std::collections::VecDeque;
use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Ticks that wait for a picture at most: a window that is hidden takes none in, and memory stays what it is.
const MOST_WAITING: usize = 32_768;
/// Everything else that waits at most.
const MOST_ARRIVALS: usize = 1024;
/// How often the thread looks whether it is still needed.
const READ_WAIT: Duration = Duration::from_millis(200);
/// Without a tick for this long, what is shown is old.
pub const STALE_AFTER: Duration = Duration::from_millis(500);

/// Reason of a connection that ends without a message.
const GONE: &str = "The program that ran the loop has ended without a message: it was killed, or it crashed; its watchdog takes the \
                    force from the device. Look at its terminal, and start the run again";

/// How the connection stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FeedState {
    /// Ticks come.
    Running,
    /// The run is over, and how.
    Ended(String, EndKind),
    /// The host went without a word, or is not understood.
    Lost(String),
}

/// What has come since the last look.
#[derive(Debug, Default)]
pub struct Arrivals {
    /// Ticks in order.
    pub records: VecDeque<TickRecord>,
    /// Parameters that changed.
    pub changes: Vec<ChangeMessage>,
    /// Requests that were answered.
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

/// A run being watched by a thread.
#[derive(Debug)]
pub struct Feed {
    waiting: Arc<Mutex<Waiting>>,
    is_over: Arc<AtomicBool>,
    asker: Asker,
    greeting: Greeting,
    run: RunDescription,
}

impl Feed {
    /// Reads from a client on a thread of its own; `wake` is called when there is something new.
    ///
    /// # Errors
    /// [`LiveError::Connection`]: the host is gone, or there is no thread.
    pub fn start(mut client: Client, wake: impl Fn() + Send + 'static) -> Result<Self, LiveError> {
        let waiting = Arc::new(Mutex::new(Waiting {
            arrivals: Arrivals::default(),
            dropped_by_host: 0,
            dropped_here: 0,
            last_tick: Instant::now(),
            state: FeedState::Running,
        }));
        let is_over = Arc::new(AtomicBool::new(false));
        let (asker, greeting, run) = (client.asker(), client.greeting().clone(), client.run().clone());
        asker.ask(Ask::Watch { every: every(run.rate_hz) })?;
        let (for_thread, over) = (Arc::clone(&waiting), Arc::clone(&is_over));
        std::thread::Builder::new().name("flotor-feed".to_owned()).spawn(move || {
            while !over.load(Ordering::Relaxed) {
                let next = client.next(READ_WAIT);
                let quiet = matches!(next, Ok(None));
                let goes_on = lock(&for_thread).take_in(next);
                if !quiet {
                    wake();
                }
                if !goes_on {
                    return;
                }
            }
        })?;
        Ok(Self { waiting, is_over, asker, greeting, run })
    }

    /// What the host said of itself when the connection was made.
    #[must_use]
    pub fn greeting(&self) -> &Greeting {
        &self.greeting
    }

    /// How the run was set up.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// Takes what has come.
    #[must_use]
    pub fn arrivals(&self) -> Arrivals {
        std::mem::take(&mut lock(&self.waiting).arrivals)
    }

    /// How the connection stands.
    #[must_use]
    pub fn state(&self) -> FeedState {
        lock(&self.waiting).state.clone()
    }

    /// True if the run goes on and its ticks do not come.
    #[must_use]
    pub fn is_stale(&self) -> bool {
        let waiting = lock(&self.waiting);
        waiting.state == FeedState::Running && waiting.last_tick.elapsed() > STALE_AFTER
    }

    /// Ticks that found no room, on the way and here.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        let waiting = lock(&self.waiting);
        waiting.dropped_by_host + waiting.dropped_here
    }

    /// Asks the host for something.
    ///
    /// # Errors
    /// [`LiveError::Connection`]: the host is gone.
    pub fn ask(&self, ask: Ask) -> Result<u64, LiveError> {
        self.asker.ask(ask)
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

impl Waiting {
    /// True while there may be more.
    fn take_in(&mut self, next: Result<Option<Event>, LiveError>) -> bool {
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
                // The newest of a parameter says what is in force: one of each is kept, however many there are.
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

fn lock(waiting: &Mutex<Waiting>) -> MutexGuard<'_, Waiting> {
    waiting.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One tick in so many is enough for pictures: at least a thousand a second.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 100 Hz to 10 kHz
fn every(rate_hz: f64) -> u32 {
    (rate_hz / 1000.0).floor().max(1.0) as u32
}
