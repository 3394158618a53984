//! Request handler of a bridge: receives requests, sends replies, and answers queries about the run.
//!
//! Zenoh calls back on two threads for all members: on these threads, only an emergency stop is parsed and pressed. Everything
//! else is queued for a separate thread, which a slow host or member may delay.

use super::emergency::{Emergency, who};
use super::launcher::Launcher;
use super::station::{Station, json};
use crate::couple::{CoupleError, MessageCounts};
use crate::keys::Name;
use crate::link::{LinkError, WaitNow};
use crate::request::{AdmissionControl, MAX_REQUEST_BYTES, Refusal, Request, Right, is_emergency_stop};
use crate::status::{State, Status};
use flotor_live::{Answer, ChangeMessage, Client, Directory, Greeting, Latch, RefusalCause, RequestClient};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::query::{Query, Queryable};

/// Timeout of a host's reply.
const ANSWER_WAIT: Duration = Duration::from_secs(2);
/// Limit on pending requests to the host, which handles some thousand requests per second. An emergency stop bypasses the queue.
const MOST_OPEN: usize = 32;
/// Limit on queued requests and queries.
const MOST_IN_LINE: usize = 256;
/// Limit on queued oversized requests.
const MOST_LONG_ONES: usize = 4;
/// Heartbeat interval of an unchanged status, for peers that missed a message.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Request handler, with the state of the bridge.
pub(super) struct RequestHandler {
    name: Name,
    emergency: Emergency,
    inside: Mutex<Inside>,
    /// Number of requests dropped by a full queue, and of oversized requests.
    turned_away: [AtomicU64; 2],
    /// Number of oversized requests in the queue, waiting for their refusal.
    long_ones: AtomicUsize,
}

/// Queue entry.
enum Asked {
    /// State query: function that reads the state, and key of the reply.
    Known(fn(&RequestHandler) -> Option<Vec<u8>>, String),
    /// Request to admit and carry out.
    Letter,
    /// Oversized request, to be refused.
    TooLong,
}

struct Inside {
    admission: AdmissionControl,
    status: Status,
    run: Option<Run>,
    launcher: Option<Launcher>,
    latch: Latch,
    reported: Option<(Status, Instant)>,
    /// Number of ticks due for publication since the bridge started, including dropped ticks.
    due: u64,
}

/// Current run.
struct Run {
    greeting: Greeting,
    description: Vec<u8>,
    request_client: RequestClient,
    /// Pending requests to the host, by request number.
    open: BTreeMap<u64, (Query, Instant)>,
}

/// Declares the handler's queryables and starts its thread: state queries are always answered, requests up to the right `allow`.
pub(super) fn open(
    session: &Session,
    handler: &Arc<RequestHandler>,
    allow: Right,
) -> Result<Vec<Queryable<()>>, CoupleError> {
    let (sender, line) = sync_channel(MOST_IN_LINE);
    let of_thread = Arc::clone(handler);
    // Ends with the last queryable.
    let thread = std::thread::Builder::new().name("flotor-requests".to_owned());
    thread.spawn(move || attend(&of_thread, &line))?;
    let mut counter = Vec::new();
    for (key, read) in [
        ("status", RequestHandler::status as fn(&RequestHandler) -> Option<Vec<u8>>),
        ("greeting", RequestHandler::greeting),
        ("run", RequestHandler::description),
    ] {
        let key = handler.name.key(key);
        let (line, name) = (sender.clone(), key.clone());
        let ask = move |query: Query| {
            // A query for state has no payload.
            if query.payload().is_none() {
                let _ = line.try_send((Asked::Known(read, name.clone()), query));
            }
        };
        counter.push(session.declare_queryable(key).callback(ask).wait_now()?);
    }
    for right in Right::ALL.into_iter().filter(|right| *right <= allow) {
        for key in right.keys() {
            let key = handler.name.key(key);
            let (handler, line) = (Arc::clone(handler), sender.clone());
            let receive = move |query: Query| handler.receive(query, &line);
            // The last part names the member.
            counter.push(session.declare_queryable(format!("{key}/*")).callback(receive).wait_now()?);
        }
    }
    Ok(counter)
}

/// Handles queue entries one by one.
fn attend(handler: &RequestHandler, line: &Receiver<(Asked, Query)>) {
    for (asked, query) in line {
        match asked {
            // Without a run there is no reply.
            Asked::Known(read, key) => {
                if let Some(bytes) = read(handler) {
                    let _ = query.reply(key, bytes).wait_now();
                }
            }
            Asked::Letter => handler.admit(query),
            Asked::TooLong => {
                reply(&query, Some(Refusal::TooLong.to_string()));
                drop(query);
                handler.long_ones.fetch_sub(1, Ordering::Relaxed);
            }
        }
    }
}

impl RequestHandler {
    pub(super) fn new(
        name: Name,
        launcher: Option<Launcher>,
        allow: Right,
        directory: &Directory,
    ) -> std::io::Result<Self> {
        let emergency = Emergency::start(directory)?;
        let latch = emergency.latch().clone();
        let inside = Inside {
            admission: AdmissionControl::default(),
            status: Status { allow, ..Status::default() },
            run: None,
            launcher,
            latch,
            reported: None,
            due: 0,
        };
        Ok(Self {
            name,
            emergency,
            inside: Mutex::new(inside),
            turned_away: Default::default(),
            long_ones: AtomicUsize::new(0),
        })
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        flotor_core::lock(&self.inside)
    }

    /// Stores a new run, and resets the number of dropped ticks.
    pub(super) fn begin(&self, client: &Client) {
        let mut inside = self.lock();
        inside.status.run = client.greeting().process;
        inside.status.title.clone_from(&client.greeting().title);
        inside.status.dropped = 0;
        inside.run = Some(Run {
            greeting: client.greeting().clone(),
            description: client.run().to_bytes(),
            request_client: client.request_client(),
            open: BTreeMap::new(),
        });
    }

    /// Clears the run, and rejects its pending requests.
    pub(super) fn end(&self) {
        let mut inside = self.lock();
        inside.status.run = 0;
        inside.status.title.clear();
        let words = "the run ended before the host replied, so the request may have had no effect";
        for (query, _) in inside.run.take().into_iter().flat_map(|run| run.open.into_values()) {
            reply(&query, Some(words.to_owned()));
        }
    }

    /// Updates the stored parameter values, for late joiners.
    pub(super) fn keep(&self, change: &ChangeMessage) {
        if let Some(run) = &mut self.lock().run {
            run.greeting.keep(change);
        }
    }

    /// Updates the number of ticks of this run that the host has dropped; they leave a gap in the tick numbers.
    pub(super) fn dropped(&self, dropped: u64) {
        let mut inside = self.lock();
        inside.due = inside.due.saturating_add(dropped.saturating_sub(inside.status.dropped));
        inside.status.dropped = dropped;
    }

    /// Updates the message counts of couplings.
    pub(super) fn carried(&self, couplings: BTreeMap<String, MessageCounts>) {
        self.lock().status.couplings = couplings;
    }

    /// Counts a published tick and returns its number.
    pub(super) fn publishing(&self) -> u64 {
        let mut inside = self.lock();
        inside.status.published += 1;
        inside.due += 1;
        inside.due
    }

    /// Returns the number of the last due tick.
    pub(super) fn due(&self) -> u64 {
        self.lock().due
    }

    /// Forwards the host's reply to the peer.
    pub(super) fn answered(&self, answer: Answer) {
        let open = self.lock().run.as_mut().and_then(|run| run.open.remove(&answer.number));
        if let Some((query, _)) = open {
            reply(&query, answer.refused);
        }
    }

    /// Rejects requests whose reply from the host has timed out. Publishes the status if it has changed, and at least once a second;
    /// changes of ticket, tick count and message counts alone do not count.
    pub(super) fn report(&self, station: &Station) -> Result<(), LinkError> {
        let mut inside = self.lock();
        if let Some(run) = &mut inside.run {
            run.open.retain(|_, (query, since)| {
                let is_late = since.elapsed() > ANSWER_WAIT;
                if is_late {
                    reply(
                        query,
                        Some(format!("the host has not replied for {} s; try again", ANSWER_WAIT.as_secs())),
                    );
                }
                !is_late
            });
        }
        let status = self.now(&inside);
        let has_changed = inside.reported.as_ref().is_none_or(|(last, since)| {
            since.elapsed() >= STATUS_PERIOD
                || Status {
                    published: last.published,
                    ticket: last.ticket,
                    couplings: last.couplings.clone(),
                    ..status.clone()
                } != *last
        });
        if has_changed {
            inside.reported = Some((status.clone(), Instant::now()));
            drop(inside);
            station.status(&status)?;
        }
        Ok(())
    }

    fn status(&self) -> Option<Vec<u8>> {
        Some(json(&self.now(&self.lock())))
    }

    fn greeting(&self) -> Option<Vec<u8>> {
        self.lock().run.as_ref().map(|run| json(&run.greeting))
    }

    fn description(&self) -> Option<Vec<u8>> {
        self.lock().run.as_ref().map(|run| run.description.clone())
    }

    /// Presses an emergency stop at once, and queues any other request. Runs on a network thread, so it must not wait.
    fn receive(&self, query: Query, line: &SyncSender<(Asked, Query)>) {
        let [no_room, too_long] = &self.turned_away;
        let payload = query.payload();
        // Check the length before copying; few long requests are queued for a refusal.
        if payload.is_some_and(|payload| payload.len() > MAX_REQUEST_BYTES) {
            too_long.fetch_add(1, Ordering::Relaxed);
            if self.long_ones.fetch_add(1, Ordering::Relaxed) >= MOST_LONG_ONES
                || line.try_send((Asked::TooLong, query)).is_err()
            {
                self.long_ones.fetch_sub(1, Ordering::Relaxed);
            }
            return;
        }
        let numbered = payload.map(|payload| payload.to_bytes()).unwrap_or_default();
        // A key expression with wildcards names no member; it is queued, and rejected as malformed.
        let asked = query.key_expr().as_str();
        if is_emergency_stop(asked, &numbered) {
            let who = who(member(asked), &self.name);
            drop(numbered);
            self.emergency.press(&who, Box::new(move |refused| reply(&query, refused)));
        } else {
            drop(numbered);
            if line.try_send((Asked::Letter, query)).is_err() {
                no_room.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Admits a queued request and carries it out.
    fn admit(&self, query: Query) {
        let numbered = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
        let mut inside = self.lock();
        let run = inside.status.run;
        match inside.admission.admit(query.key_expr().as_str(), &numbered, run) {
            Err(refusal) => reply(&query, Some(refusal.to_string())),
            Ok(request) => inside.follow(&request, query),
        }
    }

    fn now(&self, inside: &Inside) -> Status {
        let is_latched = inside.latch.state().pressed.is_some();
        let state = match (is_latched, &inside.run) {
            (true, _) => State::EmergencyStopped,
            (false, Some(_)) => State::Running,
            (false, None) => State::Waiting,
        };
        let (mut refused, ticket) = (inside.admission.refused().clone(), inside.admission.ticket());
        for (refusal, count) in [Refusal::Busy, Refusal::TooLong].into_iter().zip(&self.turned_away) {
            let count = count.load(Ordering::Relaxed);
            if count > 0 {
                *refused.entry(refusal).or_default() += count;
            }
        }
        Status { state, refused, ticket, ..inside.status.clone() }
    }
}

impl Inside {
    fn follow(&mut self, request: &Request, query: Query) {
        match (request.ask(), &mut self.run) {
            (Some(_), Some(run)) if run.open.len() >= MOST_OPEN => {
                reply(&query, Some(self.admission.refuse(Refusal::Busy).to_string()));
            }
            (Some(ask), Some(run)) => match run.request_client.ask(ask) {
                // The lock is held, so that the reply cannot be handled before the request is stored.
                Ok(number) => {
                    run.open.insert(number, (query, Instant::now()));
                }
                Err(error) => reply(&query, Some(error.to_string())),
            },
            (Some(_), None) => reply(&query, Some("no host is running; start a run first".to_owned())),
            (None, _) => {
                let done = match request {
                    Request::Release => self
                        .latch
                        .release(&format!("{} over the network", member(query.key_expr().as_str())))
                        .map(drop)
                        .map_err(|e| e.to_string()),
                    _ => self.start(),
                };
                reply(&query, done.err());
            }
        }
    }

    fn start(&mut self) -> Result<(), String> {
        if let Some(pressed) = self.latch.state().pressed {
            return Err(format!(
                "the emergency stop is pressed ({pressed}); release the emergency stop first, with `flotor \
                 release` on the machine of the bridge, or with `flotor bridge ask NAME release`"
            ));
        }
        if self.run.is_some() {
            return Err("a run is active; stop the run first".to_owned());
        }
        let launcher = self.launcher.as_mut();
        launcher.ok_or("the bridge has no scene to start; start the bridge with `--scene FILE`")?.start()
    }
}

/// Returns the member's name in a key.
fn member(key: &str) -> &str {
    key.rsplit('/').next().unwrap_or_default()
}

/// Sends the reply to a request; errors of the network are ignored.
fn reply(query: &Query, refused: Option<String>) {
    let answer = json(&Answer { number: 0, refused, cause: RefusalCause::Other });
    let _ = query.reply(query.key_expr(), answer).wait_now();
}
