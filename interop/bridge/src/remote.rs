//! Client of a bridge: receives a remote run, and sends requests.

use crate::access;
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
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Length of the queue at which ticks are dropped and counted as lost: eight seconds at 1 kHz.
const MOST_TICKS: usize = 8192;
/// Length of the queue at which other events are dropped: a client that is behind with ticks still receives the end.
const MOST_WAITING: usize = 2 * MOST_TICKS;
/// Timeout of a reply.
const ANSWER_WAIT: Duration = Duration::from_secs(3);
/// Timeout of the reply to an emergency stop, which may wait for the hosts' confirmation of an earlier stop and then of this one.
const STOP_WAIT: Duration = Duration::from_secs(5);
/// Timeout and poll interval of the first contact of a new session with a bridge.
const SEEN_WAIT: Duration = Duration::from_secs(1);
const SEEN_PERIOD: Duration = Duration::from_millis(20);
/// Limit on attempts to send a request while the current run changes.
const MOST_LOOKS: u32 = 5;
/// Poll interval while bridge or run are absent.
const LOOK_PERIOD: Duration = Duration::from_millis(300);

/// Event of a remote run.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // nearly every event is a tick: a box would allocate for each
pub enum RemoteEvent {
    /// Tick of the run.
    Tick(TickRecord),
    /// A parameter changed.
    Change(Change),
    /// The run is over.
    End(End),
    /// The bridge has disappeared from the network.
    Gone,
}

/// Subscription to a bridge: events of its runs, and a client for requests.
pub struct Remote {
    session: Session,
    name: Name,
    events: Receiver<RemoteEvent>,
    queue: Queue,
    requests: RequestClient,
    _all: Subscriber<()>,
    _alive: Subscriber<()>,
}

/// Client that sends requests, from any thread; clones share the request number and the run.
#[derive(Clone)]
pub struct RequestClient {
    session: Session,
    name: Name,
    /// Member name in the keys.
    member: Name,
    /// Last request number; locked until the request is sent, so that requests leave in the order of their numbers.
    number: Arc<Mutex<u64>>,
    /// Process id of the run that requests are for; 0: the current run.
    run: Arc<AtomicU64>,
}

impl Remote {
    /// Subscribes to the messages of a bridge, which may also start later.
    ///
    /// # Errors
    /// If a network operation fails.
    pub fn listen(session: &Link, name: &Name) -> Result<Self, LinkError> {
        let (sender, events) = channel();
        let queue = Queue { sender, waiting: Arc::default(), lost: Arc::default() };
        let mut decoder = Decoder { queue: queue.clone(), pose: None, number: None };
        let of_liveliness = queue.clone();
        let all = session
            .declare_subscriber(name.key("*"))
            .callback_mut(move |sample| decoder.decode(&sample))
            .wait()?;
        let alive = session
            .liveliness()
            .declare_subscriber(name.key("alive"))
            .callback(move |sample| {
                if sample.kind() == SampleKind::Delete {
                    of_liveliness.put(RemoteEvent::Gone);
                }
            })
            .wait()?;
        let requests = RequestClient {
            session: Session::clone(session),
            name: name.clone(),
            member: session.member().clone(),
            number: Arc::default(),
            run: Arc::default(),
        };
        Ok(Self {
            session: Session::clone(session),
            name: name.clone(),
            events,
            queue,
            requests,
            _all: all,
            _alive: alive,
        })
    }

    /// Waits for a run, and directs later requests to it. Returns its greeting and description; `None` once `stop` is set.
    ///
    /// # Errors
    /// If a network operation fails.
    pub fn wait_for_run(&self, stop: &AtomicBool) -> Result<Option<(Greeting, RunDescription)>, LinkError> {
        while !stop.load(Ordering::Relaxed) {
            let greeting =
                self.get("greeting")?.and_then(|bytes| serde_json::from_slice::<Greeting>(&bytes).ok());
            let run = self.get("run")?.and_then(|bytes| RunDescription::from_bytes(&bytes).ok());
            if let (Some(greeting), Some(run)) = (greeting, run) {
                self.requests.run.store(u64::from(greeting.process), Ordering::Relaxed);
                return Ok(Some((greeting, run)));
            }
            std::thread::sleep(LOOK_PERIOD);
        }
        Ok(None)
    }

    /// Waits for the next event; `None` on timeout.
    #[must_use]
    pub fn next(&self, timeout: Duration) -> Option<RemoteEvent> {
        match self.events.recv_timeout(timeout) {
            Ok(event) => {
                self.queue.waiting.fetch_sub(1, Ordering::Relaxed);
                Some(event)
            }
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(RemoteEvent::Gone),
        }
    }

    /// Returns the number of ticks known to be lost on the network or in the queue.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.queue.lost.load(Ordering::Relaxed)
    }

    /// Requests the status of the bridge; `None` without a valid reply.
    ///
    /// # Errors
    /// If a network operation fails.
    pub fn status(&self) -> Result<Option<Status>, LinkError> {
        self.requests.status()
    }

    /// Returns a client for requests to the bridge.
    #[must_use]
    pub fn requests(&self) -> RequestClient {
        self.requests.clone()
    }

    fn get(&self, what: &str) -> Result<Option<Vec<u8>>, LinkError> {
        get(&self.session, &self.name, what)
    }
}

fn get(session: &Session, name: &Name, what: &str) -> Result<Option<Vec<u8>>, LinkError> {
    let answers = session.get(name.key(what)).timeout(ANSWER_WAIT).wait()?;
    Ok(first(&answers))
}

impl RequestClient {
    /// Sends a request and waits for the reply.
    ///
    /// # Errors
    /// The cause as text: reason for the refusal, network error, or no reply within the timeout.
    pub fn run(&self, request: Request) -> Result<(), String> {
        let right = request.right();
        if right == Right::Watch {
            // An emergency stop needs no status first.
            return seen(|| done(&self.send(request.clone(), &Status::default())?));
        }
        let is_for_the_current = right == Right::Own || self.run.load(Ordering::Relaxed) == 0;
        let mut looks = 0;
        loop {
            let status = seen(|| self.status().map_err(|error| error.to_string()))?;
            if status.allow < right {
                let word = request.key().trim_start_matches("ask/");
                return Err(format!(
                    "the bridge `{}` rejects `{word}`; start the bridge with `flotor bridge serve --allow {}`",
                    self.name,
                    access::word(right)
                ));
            }
            looks += 1;
            match done(&self.send(request.clone(), &status)?) {
                // Retry: a run has begun or ended since the status was read.
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
        let mut number = flotor_core::lock(&self.number);
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
        let numbered = NumberedRequest { session, number: *number, run, ticket, request };
        let get = self.session.get(key).timeout(wait).payload(numbered.to_bytes());
        // Bridges on two machines may have the same name: all of them must have carried out the request.
        let get = get.target(QueryTarget::All).consolidation(ConsolidationMode::None);
        get.wait().map_err(|error| LinkError::from(error).to_string())
    }
}

/// Error text for a missing reply, with the possible causes.
const NOBODY_ANSWERS: &str = "no reply: no bridge of this name is reachable, or it is overloaded or rejects this request \
of this member; check the name with `flotor bridge list`, and the rights with which the keys were created";

/// Replies to a query.
type Answers = FifoChannelHandler<Reply>;

/// Retries until there is a reply: a new session may not have discovered the bridge yet.
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

/// Checks that all replies confirm the request; `None` without a reply.
fn done(answers: &Answers) -> Result<Option<()>, String> {
    let mut is_answered = None;
    for answer in answers.iter() {
        let answer = answer.into_result().map_err(|_| NOBODY_ANSWERS)?;
        let answer: Answer = serde_json::from_slice(&answer.payload().to_bytes()).map_err(|error| {
            format!("malformed reply: {error}; use the same build of Flotor as the bridge")
        })?;
        answer.refused.map_or(Ok(()), Err)?;
        is_answered = Some(());
    }
    Ok(is_answered)
}

/// Returns the payload of the first reply.
fn first(answers: &Answers) -> Option<Vec<u8>> {
    let sample = answers.iter().find_map(|answer| answer.into_result().ok());
    sample.map(|sample| sample.payload().to_bytes().into_owned())
}

/// Bounded queue from the network's threads to the caller; lost ticks are counted.
#[derive(Clone)]
struct Queue {
    sender: Sender<RemoteEvent>,
    waiting: Arc<AtomicUsize>,
    lost: Arc<AtomicU64>,
}

impl Queue {
    fn put(&self, event: RemoteEvent) {
        let is_tick = matches!(event, RemoteEvent::Tick(_));
        let most = if is_tick { MOST_TICKS } else { MOST_WAITING };
        if self.waiting.load(Ordering::Relaxed) >= most {
            self.lose(u64::from(is_tick));
            return;
        }
        self.waiting.fetch_add(1, Ordering::Relaxed);
        // Fails only if the receiver was dropped.
        let _ = self.sender.send(event);
    }

    fn lose(&self, ticks: u64) {
        self.lost.fetch_add(ticks, Ordering::Relaxed);
    }
}

/// Decoder that assembles messages into events, on the network's thread.
struct Decoder {
    queue: Queue,
    pose: Option<Vec<u8>>,
    number: Option<u64>,
}

impl Decoder {
    fn decode(&mut self, sample: &Sample) {
        let payload = sample.payload().to_bytes();
        let number = sample.attachment().and_then(|bytes| bytes.to_bytes().as_ref().try_into().ok());
        let number = number.map(u64::from_le_bytes);
        let event = match sample.key_expr().as_str().rsplit('/').next() {
            Some("tf") => {
                self.pose = Some(payload.into_owned());
                return;
            }
            Some("tick") => self.tick(&payload, number),
            Some("change") => {
                flotor_record::change_from_bytes(&payload, number.unwrap_or(0)).ok().map(RemoteEvent::Change)
            }
            Some("end") => self.end(&payload, number),
            _ => return,
        };
        if let Some(event) = event {
            self.queue.put(event);
        }
    }

    /// Decodes the end; missing ticks before it are counted as lost.
    fn end(&mut self, payload: &[u8], last: Option<u64>) -> Option<RemoteEvent> {
        if let (Some(received), Some(last)) = (self.number, last) {
            self.queue.lose(last.saturating_sub(received));
            self.number = Some(last.max(received));
        }
        serde_json::from_slice(payload).ok().map(RemoteEvent::End)
    }

    /// Decodes a tick, whose pose must have arrived before; counts gaps in the numbers and undecodable ticks as lost.
    fn tick(&mut self, payload: &[u8], number: Option<u64>) -> Option<RemoteEvent> {
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
        record.map(RemoteEvent::Tick)
    }
}

/// Returns the names of all bridges on the network, sorted, each once.
///
/// # Errors
/// If a network operation fails.
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
