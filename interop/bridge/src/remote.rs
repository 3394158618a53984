//! A run on another machine: what it tells, and how it is asked for something.

use crate::keys::Name;
use crate::link::{Link, LinkError};
use crate::request::{NumberedRequest, Refusal, Request, Right};
use crate::status::Status;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_live::{Answer, End, Greeting};
use flotor_record::{RunDescription, tick_from_messages};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Ticks that wait here at most: eight seconds at 1 kHz. What finds no room is counted as lost.
const MOST_TICKS: usize = 8192;
/// Everything that waits here at most: who falls behind with ticks still hears of the end.
const MOST_WAITING: usize = 2 * MOST_TICKS;
/// How long a bridge may take to answer.
const ANSWER_WAIT: Duration = Duration::from_secs(3);
/// The same for the emergency stop: until the hosts have confirmed an earlier one, and this one.
const STOP_WAIT: Duration = Duration::from_secs(5);
/// How long a bridge may take to be seen by a new session, and how often it is looked for.
const SEEN_WAIT: Duration = Duration::from_secs(1);
const SEEN_PERIOD: Duration = Duration::from_millis(20);
/// How often a request for the current run is made anew because that has changed meanwhile.
const MOST_LOOKS: u32 = 5;
/// Pause between two looks for a bridge or run that is not there.
const LOOK_PERIOD: Duration = Duration::from_millis(300);

/// What a remote run tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// A tick.
    Tick(TickRecord),
    /// A parameter changed.
    Change(Change),
    /// The run is over.
    End(End),
    /// The bridge cannot be seen any more.
    Gone,
}

/// A bridge on the network, from afar.
pub struct Remote {
    session: Session,
    name: Name,
    told: Receiver<Told>,
    queue: Queue,
    errand: Errand,
    _all: Subscriber<()>,
    _alive: Subscriber<()>,
}

/// Carries requests to a bridge, from any thread; clone it freely.
#[derive(Clone)]
pub struct Errand {
    session: Session,
    name: Name,
    /// As whom it asks: the name in the keys.
    member: Name,
    /// The last that was used; held until the letter has left, for letters to leave in the order of their numbers.
    number: Arc<Mutex<u64>>,
    /// Process of the run that is meant; 0: the current one.
    run: Arc<AtomicU64>,
}

impl Remote {
    /// Listens to a bridge, whether it is there yet or not.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn listen(session: &Link, name: &Name) -> Result<Self, LinkError> {
        let (sender, told) = channel();
        let queue = Queue { sender, waiting: Arc::default(), lost: Arc::default() };
        let mut ear = Ear { queue: queue.clone(), pose: None, number: None };
        let of_liveliness = queue.clone();
        let all =
            session.declare_subscriber(name.key("*")).callback_mut(move |sample| ear.hear(&sample)).wait()?;
        let alive = session
            .liveliness()
            .declare_subscriber(name.key("alive"))
            .callback(move |sample| {
                if sample.kind() == SampleKind::Delete {
                    of_liveliness.put(Told::Gone);
                }
            })
            .wait()?;
        let errand = Errand {
            session: Session::clone(session),
            name: name.clone(),
            member: session.member().clone(),
            number: Arc::default(),
            run: Arc::default(),
        };
        Ok(Self {
            session: Session::clone(session),
            name: name.clone(),
            told,
            queue,
            errand,
            _all: all,
            _alive: alive,
        })
    }

    /// Waits for a run: who it is, and how it was set up. Nothing if told to stop.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn wait_for_run(&self, stop: &AtomicBool) -> Result<Option<(Greeting, RunDescription)>, LinkError> {
        while !stop.load(Ordering::Relaxed) {
            let greeting =
                self.get("greeting")?.and_then(|bytes| serde_json::from_slice::<Greeting>(&bytes).ok());
            let run = self.get("run")?.and_then(|bytes| RunDescription::from_bytes(&bytes).ok());
            if let (Some(greeting), Some(run)) = (greeting, run) {
                self.errand.run.store(u64::from(greeting.process), Ordering::Relaxed);
                return Ok(Some((greeting, run)));
            }
            std::thread::sleep(LOOK_PERIOD);
        }
        Ok(None)
    }

    /// the next report; nothing if there is none in this time.
    #[must_use]
    pub fn next(&self, timeout: Duration) -> Option<Told> {
        match self.told.recv_timeout(timeout) {
            Ok(told) => {
                self.queue.waiting.fetch_sub(1, Ordering::Relaxed);
                Some(told)
            }
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Told::Gone),
        }
    }

    /// Ticks that were published and did not get here, as far as is known.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.queue.lost.load(Ordering::Relaxed)
    }

    /// How the bridge is doing.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn status(&self) -> Result<Option<Status>, LinkError> {
        self.errand.status()
    }

    /// The way to ask for something.
    #[must_use]
    pub fn errand(&self) -> Errand {
        self.errand.clone()
    }

    fn get(&self, what: &str) -> Result<Option<Vec<u8>>, LinkError> {
        get(&self.session, &self.name, what)
    }
}

fn get(session: &Session, name: &Name, what: &str) -> Result<Option<Vec<u8>>, LinkError> {
    let answers = session.get(name.key(what)).timeout(ANSWER_WAIT).wait()?;
    Ok(first(&answers))
}

impl Errand {
    /// Asks for something and waits for the answer: the reason if it is refused.
    ///
    /// # Errors
    /// In words, for people.
    pub fn run(&self, request: Request) -> Result<(), String> {
        let right = request.right();
        if right == Right::Watch {
            // Of the emergency stop nothing is asked first.
            return seen(|| done(&self.send(request.clone(), &Status::default())?));
        }
        let is_for_the_current = right == Right::Own || self.run.load(Ordering::Relaxed) == 0;
        let mut looks = 0;
        loop {
            let status = seen(|| self.status().map_err(|error| error.to_string()))?;
            if status.allow < right {
                let word = request.key().trim_start_matches("ask/");
                return Err(format!(
                    "the bridge `{}` does not take `{word}`; `flotor bridge serve --allow` says what it takes",
                    self.name
                ));
            }
            looks += 1;
            match done(&self.send(request.clone(), &status)?) {
                // A run has begun or ended since the status said which one is on.
                Err(words)
                    if is_for_the_current && looks < MOST_LOOKS && words == Refusal::Stale.to_string() => {}
                answered => return answered?.ok_or_else(|| NOBODY_ANSWERS.to_owned()),
            }
        }
    }

    fn status(&self) -> Result<Option<Status>, LinkError> {
        let status = get(&self.session, &self.name, "status")?;
        Ok(status.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
    }

    fn send(&self, request: Request, status: &Status) -> Result<Answers, String> {
        let key = format!("{}/{}", self.name.key(request.key()), self.member);
        let mut number = self.number.lock().unwrap_or_else(PoisonError::into_inner);
        *number += 1;
        let run = match request.right() {
            Right::Own => status.run,
            Right::Watch | Right::Operate => match u32::try_from(self.run.load(Ordering::Relaxed)) {
                Ok(0) | Err(_) => status.run,
                Ok(run) => run,
            },
        };
        let (session, ticket) = (self.session.zid().to_string(), status.ticket);
        let wait = if request == Request::EmergencyStop { STOP_WAIT } else { ANSWER_WAIT };
        let letter = NumberedRequest { session, number: *number, run, ticket, request };
        let get = self.session.get(key).timeout(wait).payload(letter.to_bytes());
        // Bridges on two machines may have one name: whatever is asked is done when all of them have.
        let get = get.target(QueryTarget::All).consolidation(ConsolidationMode::None);
        get.wait().map_err(|error| LinkError::from(error).to_string())
    }
}

/// Why there is no answer, as far as can be known here.
const NOBODY_ANSWERS: &str = "nobody answers: the bridge is gone, or does not take this request, or not from this peer; \
                              `flotor bridge serve --allow` and the network's access control say who may";

/// What comes back.
type Answers = FifoChannelHandler<Reply>;

/// Asks until there is an answer: a session that was opened a moment ago may not know of the bridge yet.
fn seen<T>(ask: impl Fn() -> Result<Option<T>, String>) -> Result<T, String> {
    let until = Instant::now() + SEEN_WAIT;
    loop {
        match ask()? {
            Some(answer) => return Ok(answer),
            None if Instant::now() < until => std::thread::sleep(SEEN_PERIOD),
            None => return Err(NOBODY_ANSWERS.to_owned()),
        }
    }
}

/// Whether all that answer have done it; nothing if none does.
fn done(answers: &Answers) -> Result<Option<()>, String> {
    let mut is_answered = None;
    for answer in answers.iter() {
        let answer = answer.into_result().map_err(|_| NOBODY_ANSWERS)?;
        let answer: Answer =
            serde_json::from_slice(&answer.payload().to_bytes()).map_err(|error| error.to_string())?;
        answer.refused.map_or(Ok(()), Err)?;
        is_answered = Some(());
    }
    Ok(is_answered)
}

/// What is answered first, if anything is.
fn first(answers: &Answers) -> Option<Vec<u8>> {
    let sample = answers.iter().find_map(|answer| answer.into_result().ok());
    sample.map(|sample| sample.payload().to_bytes().into_owned())
}

/// The way from the network's threads to who listens: of bounded length, and what is lost on it is counted.
#[derive(Clone)]
struct Queue {
    sender: Sender<Told>,
    waiting: Arc<AtomicUsize>,
    lost: Arc<AtomicU64>,
}

impl Queue {
    fn put(&self, told: Told) {
        let is_tick = matches!(told, Told::Tick(_));
        let most = if is_tick { MOST_TICKS } else { MOST_WAITING };
        if self.waiting.load(Ordering::Relaxed) >= most {
            self.lose(u64::from(is_tick));
            return;
        }
        self.waiting.fetch_add(1, Ordering::Relaxed);
        // Without a listener there is nobody to tell.
        let _ = self.sender.send(told);
    }

    fn lose(&self, ticks: u64) {
        self.lost.fetch_add(ticks, Ordering::Relaxed);
    }
}

/// Puts messages together to what they tell, in the network's thread.
struct Ear {
    queue: Queue,
    pose: Option<Vec<u8>>,
    number: Option<u64>,
}

impl Ear {
    fn hear(&mut self, sample: &Sample) {
        let payload = sample.payload().to_bytes();
        let number = sample.attachment().and_then(|bytes| bytes.to_bytes().as_ref().try_into().ok());
        let number = number.map(u64::from_le_bytes);
        let told = match sample.key_expr().as_str().rsplit('/').next() {
            Some("tf") => {
                self.pose = Some(payload.into_owned());
                return;
            }
            Some("tick") => self.tick(&payload, number),
            Some("change") => {
                flotor_record::change_from_bytes(&payload, number.unwrap_or(0)).ok().map(Told::Change)
            }
            Some("end") => self.end(&payload, number),
            _ => return,
        };
        if let Some(told) = told {
            self.queue.put(told);
        }
    }

    /// The end; what was to come before it and did not is lost.
    fn end(&mut self, payload: &[u8], last: Option<u64>) -> Option<Told> {
        if let (Some(heard), Some(last)) = (self.number, last) {
            self.queue.lose(last.saturating_sub(heard));
            self.number = Some(last.max(heard));
        }
        serde_json::from_slice(payload).ok().map(Told::End)
    }

    /// A tick, if its pose came before it; gaps in the numbers are losses.
    fn tick(&mut self, payload: &[u8], number: Option<u64>) -> Option<Told> {
        if let Some(number) = number {
            let missing = self.number.map_or(0, |last| number.saturating_sub(last).saturating_sub(1));
            self.queue.lose(missing);
            self.number = Some(number);
        }
        let pose = self.pose.take();
        let record = pose.and_then(|pose| tick_from_messages(&pose, payload).ok());
        if record.is_none() {
            self.queue.lose(1);
        }
        record.map(Told::Tick)
    }
}

/// Bridges that can be seen.
///
/// # Errors
/// [`LinkError`]: the network refuses.
pub fn bridges(session: &Session) -> Result<Vec<Name>, LinkError> {
    let answers = session.liveliness().get("flotor/*/alive").timeout(ANSWER_WAIT).wait()?;
    let mut names: Vec<Name> = answers
        .iter()
        .filter_map(|answer| Name::of_key(answer.into_result().ok()?.key_expr().as_str()))
        .collect();
    names.sort();
    names.dedup();
    Ok(names)
}
