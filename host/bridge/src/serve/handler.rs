//! Where requests arrive: letters in, answers out, and what is known of the run for who asks.

use super::station::{Station, json};
use super::{Launcher, WaitNow};
use crate::couple::Carried;
use crate::keys::Name;
use crate::link::LinkError;
use crate::request::{Gate, MAX_REQUEST_BYTES, Refusal, Request, Right};
use crate::status::{State, Status};
use flotor_live::{Answer, Asker, ChangeMessage, Client, Greeting, RefusalCause};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::query::{Query, Queryable};

/// How long a host may take to answer.
const ANSWER_WAIT: Duration = Duration::from_secs(2);
/// Requests that wait for the host at most, which answers some thousand a second: an emergency stop is never far behind them.
const MOST_OPEN: usize = 32;
/// How often the status goes out when nothing changes: who lost one gets the next.
const STATUS_PERIOD: Duration = Duration::from_secs(1);

/// Everything a bridge knows.
pub(super) struct RequestHandler {
    name: Name,
    inside: Mutex<Inside>,
}

struct Inside {
    gate: Gate,
    status: Status,
    run: Option<Run>,
    launcher: Option<Launcher>,
    is_latched: bool,
    reported: Option<(Status, Instant)>,
    /// Ticks that were to be published since the bridge started, dropped ones among them.
    due: u64,
}

/// The current run.
struct Run {
    greeting: Greeting,
    description: Vec<u8>,
    asker: Asker,
    /// Questions on their way to the host, by the number its answer will carry.
    open: BTreeMap<u64, (Query, Instant)>,
}

/// Opens the handler: for reading always, for requests as far as `allow` goes.
pub(super) fn open(
    session: &Session,
    handler: &Arc<RequestHandler>,
    allow: Right,
) -> Result<Vec<Queryable<()>>, LinkError> {
    let mut counter = Vec::new();
    for (key, read) in [
        ("status", RequestHandler::status as fn(&RequestHandler) -> Option<Vec<u8>>),
        ("greeting", RequestHandler::greeting),
        ("run", RequestHandler::description),
    ] {
        let key = handler.name.key(key);
        let (handler, name) = (Arc::clone(handler), key.clone());
        let answer = move |query: Query| {
            // Without a run there is nothing to say, which is an answer, too.
            if let Some(bytes) = read(&handler) {
                let _ = query.reply(&name, bytes).wait_now();
            }
        };
        counter.push(session.declare_queryable(key).callback(answer).wait_now()?);
    }
    for right in Right::ALL.into_iter().filter(|right| *right <= allow) {
        for key in right.keys() {
            let key = handler.name.key(key);
            let (handler, name) = (Arc::clone(handler), key.clone());
            let receive = move |query: Query| handler.receive(&name, query);
            counter.push(session.declare_queryable(key).callback(receive).wait_now()?);
        }
    }
    Ok(counter)
}

impl RequestHandler {
    pub(super) fn new(name: Name, launcher: Option<Launcher>) -> Self {
        let inside = Inside {
            gate: Gate::default(),
            status: Status::default(),
            run: None,
            launcher,
            is_latched: false,
            reported: None,
            due: 0,
        };
        Self { name, inside: Mutex::new(inside) }
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A run begins.
    pub(super) fn begin(&self, client: &Client) {
        let mut inside = self.lock();
        inside.status.run = client.greeting().process;
        inside.status.title.clone_from(&client.greeting().title);
        inside.status.dropped = 0;
        inside.run = Some(Run {
            greeting: client.greeting().clone(),
            description: client.run().to_bytes(),
            asker: client.asker(),
            open: BTreeMap::new(),
        });
    }

    /// The run is over: whoever still waits for an answer gets one.
    pub(super) fn end(&self) {
        let mut inside = self.lock();
        inside.status.run = 0;
        inside.status.title.clear();
        for (query, _) in inside.run.take().into_iter().flat_map(|run| run.open.into_values()) {
            reply(&query, Some("the run ended before the host answered".to_owned()));
        }
    }

    /// Keeps the values in force for late joiners.
    pub(super) fn keep(&self, change: &ChangeMessage) {
        if let Some(run) = &mut self.lock().run {
            run.greeting.keep(change);
        }
    }

    /// What the host could not hand over in this run so far: a gap in the numbers, for all to see.
    pub(super) fn dropped(&self, dropped: u64) {
        let mut inside = self.lock();
        inside.due += dropped.saturating_sub(inside.status.dropped);
        inside.status.dropped = dropped;
    }

    /// What was carried for couplings.
    pub(super) fn carried(&self, couplings: BTreeMap<String, Carried>) {
        self.lock().status.couplings = couplings;
    }

    /// The number of the tick to be published now.
    pub(super) fn publishing(&self) -> u64 {
        let mut inside = self.lock();
        inside.status.published += 1;
        inside.due += 1;
        inside.due
    }

    /// The number of the last tick that was to be published.
    pub(super) fn due(&self) -> u64 {
        self.lock().due
    }

    /// The host has answered.
    pub(super) fn answered(&self, answer: Answer) {
        let open = self.lock().run.as_mut().and_then(|run| run.open.remove(&answer.number));
        if let Some((query, _)) = open {
            reply(&query, answer.refused);
        }
    }

    /// Publishes the status if it has changed, and gives up on answers that do not come.
    pub(super) fn report(&self, station: &Station) -> Result<(), LinkError> {
        let mut inside = self.lock();
        if let Some(run) = &mut inside.run {
            run.open.retain(|_, (query, since)| {
                let is_late = since.elapsed() > ANSWER_WAIT;
                if is_late {
                    reply(query, Some("the host does not answer".to_owned()));
                }
                !is_late
            });
        }
        let status = inside.now();
        let has_changed = match &inside.reported {
            None => true,
            Some((last, since)) => {
                since.elapsed() >= STATUS_PERIOD
                    || Status {
                        published: last.published,
                        couplings: last.couplings.clone(),
                        ..status.clone()
                    } != *last
            }
        };
        if has_changed {
            inside.reported = Some((status.clone(), Instant::now()));
            drop(inside);
            station.status(&status)?;
        }
        Ok(())
    }

    fn status(&self) -> Option<Vec<u8>> {
        Some(json(&self.lock().now()))
    }

    fn greeting(&self) -> Option<Vec<u8>> {
        self.lock().run.as_ref().map(|run| json(&run.greeting))
    }

    fn description(&self) -> Option<Vec<u8>> {
        self.lock().run.as_ref().map(|run| run.description.clone())
    }

    /// A letter on one of our keys.
    fn receive(&self, key: &str, query: Query) {
        // A long one is not even copied; one on a pattern of keys is not meant for us.
        let length = query.payload().map_or(0, zenoh::bytes::ZBytes::len);
        let letter =
            query.payload().filter(|_| length <= MAX_REQUEST_BYTES).map(|payload| payload.to_bytes());
        let letter = match letter {
            Some(letter) => letter.into_owned(),
            None => vec![0; length.min(MAX_REQUEST_BYTES + 1)],
        };
        let asked = if query.key_expr().as_str() == key { key } else { "" };
        let mut inside = self.lock();
        let run = inside.status.run;
        match inside.gate.admit(asked, &letter, run) {
            Err(refusal) => reply(&query, Some(refusal.to_string())),
            Ok(request) => inside.follow(&request, query),
        }
    }
}

impl Inside {
    fn now(&self) -> Status {
        let state = match (self.is_latched, &self.run) {
            (true, _) => State::EmergencyStopped,
            (false, Some(_)) => State::Running,
            (false, None) => State::Waiting,
        };
        Status { state, refused: self.gate.refused().clone(), ..self.status.clone() }
    }

    fn follow(&mut self, request: &Request, query: Query) {
        self.is_latched |= *request == Request::EmergencyStop;
        match (request.ask(), &mut self.run) {
            (Some(_), Some(run)) if run.open.len() >= MOST_OPEN && *request != Request::EmergencyStop => {
                reply(&query, Some(self.gate.refuse(Refusal::Busy).to_string()));
            }
            (Some(ask), Some(run)) => match run.asker.ask(ask) {
                // The lock is held: the answer cannot come before the question is noted.
                Ok(number) => {
                    run.open.insert(number, (query, Instant::now()));
                }
                Err(error) => reply(&query, Some(error.to_string())),
            },
            (Some(_), None) => {
                let is_done = *request == Request::EmergencyStop;
                reply(&query, (!is_done).then(|| "no host runs".to_owned()));
            }
            (None, _) => {
                let done = match request {
                    Request::Release => {
                        self.is_latched = false;
                        Ok(())
                    }
                    _ => self.start(),
                };
                reply(&query, done.err());
            }
        }
    }

    fn start(&mut self) -> Result<(), String> {
        if self.is_latched {
            return Err("the emergency stop was pressed; its owner releases it first".to_owned());
        }
        if self.run.is_some() {
            return Err("a run is on; stop it first".to_owned());
        }
        let launcher = self.launcher.as_mut();
        launcher.ok_or("the bridge has no scene to start; `--scene FILE` names one")?.start()
    }
}

/// What became of a letter. Nobody waits for whether it arrived.
fn reply(query: &Query, refused: Option<String>) {
    let answer = json(&Answer { number: 0, refused, cause: RefusalCause::Other });
    let _ = query.reply(query.key_expr(), answer).wait_now();
}
