//! Shared state of clients and callback connections, with their pending events.

use crate::controller::Sample;
use crate::ml_api::controller::{Answer, Commanders, Controller, Flight, Silence};
use crate::ml_api::injected_fault::Plan;
use flotor_maglev::ml_api::{
    Event, EventKind, FaultBits, Function, Reply, Request, Results, Status, WirePose,
};
use std::collections::VecDeque;

/// Callback that receives each log line.
pub type Log = Box<dyn Fn(std::fmt::Arguments<'_>) + Send + Sync>;

/// Id of a connection; for a callback connection, also the token.
pub(super) type Id = u64;

/// Maximum number of queued events; a client that reads no events loses the oldest.
pub(super) const EVENTS: usize = 256;
/// Id of the first connection.
const FIRST: Id = 101;

pub(super) struct State {
    pub(super) controller: Controller,
    pub(super) plan: Plan,
    pub(super) clients: Vec<Client>,
    pub(super) callbacks: Vec<Callback>,
    pub(super) commander: Option<Id>,
    pub(super) next_id: Id,
    pub(super) restarts_with_ticks: bool,
    pub(super) is_restart_wanted: bool,
    pub(super) reported: (Flight, FaultBits),
    pub(super) now_s: f64,
}

pub(super) struct Client {
    pub(super) id: Id,
    pub(super) callback: Option<Id>,
    pub(super) registered: Vec<EventKind>,
    /// Time since the loss of the callback connection while registered for ticks, s.
    pub(super) ticks_lost_s: Option<f64>,
}

pub(super) struct Callback {
    pub(super) token: Id,
    pub(super) events: VecDeque<Event>,
    pub(super) tick: Option<WirePose>,
    /// Age of the unacknowledged tick, s.
    pub(super) tick_open_s: Option<f64>,
    pub(super) end: Option<CallbackEnd>,
}

/// Cause of the end of a callback connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CallbackEnd {
    /// Requested by the client; an end event is sent.
    Asked,
    /// The client is disconnected.
    Gone,
    /// Orderly close without an end event.
    Close,
}

/// Next item to send on a callback connection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Next {
    Event(Event),
    LateTick(Event),
    End(CallbackEnd),
}

impl Client {
    pub(super) fn wants(&self, kind: EventKind) -> bool {
        self.callback.is_some() && self.registered.contains(&kind)
    }

    fn takes(&self, token: Id, kind: EventKind) -> bool {
        self.callback == Some(token) && self.wants(kind)
    }
}

impl State {
    pub(super) fn new(controller: Controller, plan: Plan, restarts_with_ticks: bool) -> Self {
        Self {
            controller,
            plan,
            clients: Vec::new(),
            callbacks: Vec::new(),
            commander: None,
            next_id: FIRST,
            restarts_with_ticks,
            is_restart_wanted: false,
            reported: (Flight::Landed, FaultBits::NONE),
            now_s: 0.0,
        }
    }

    pub(super) fn begin(&mut self, sample: &Sample, dt_s: f64, log: &Log) {
        let is_ticking = self.clients.iter().any(|client| client.wants(EventKind::Tick));
        let injected = self.plan.advance(self.controller.flight, is_ticking, dt_s);
        self.controller.inject(injected);
        self.controller.sense(sample, dt_s);
        self.now_s += dt_s;
        self.tell_events();
        self.push_ticks();
        self.watch_silence(dt_s, log);
        self.log_changes(log);
    }

    pub(super) fn callback(&mut self, token: Option<Id>) -> Option<&mut Callback> {
        self.callbacks.iter_mut().find(|callback| Some(callback.token) == token)
    }

    fn client(&mut self, id: Id) -> Option<&mut Client> {
        self.clients.iter_mut().find(|client| client.id == id)
    }

    pub(super) fn execute(&mut self, id: Id, request: &Request) -> Answer {
        let function = request.function();
        if function.commands() && self.controller.config.commanders == Commanders::One {
            let commander = *self.commander.get_or_insert(id);
            if commander != id {
                return Answer::Now(Reply::failed(Some(function), Status::RECEIVE_ONLY));
            }
        } else if function.commands() {
            self.commander = Some(id);
        }
        let status = match *request {
            Request::MapToken(token) => self.map(id, token),
            Request::Plain(Function::StopCallbacks) => {
                let token = self.client(id).and_then(|client| client.callback.take());
                if let Some(callback) = self.callback(token) {
                    callback.end.get_or_insert(CallbackEnd::Asked);
                }
                if let Some(client) = self.client(id) {
                    client.registered.clear();
                    client.ticks_lost_s = None;
                }
                Status::OK
            }
            Request::Register(function, _) => self.register(id, function),
            _ => return self.controller.answer(request),
        };
        Answer::Now(Reply { status, results: Results::None })
    }

    fn map(&mut self, id: Id, token: i32) -> Status {
        let token = Id::try_from(token).ok();
        let is_anothers = self.clients.iter().any(|client| client.id != id && client.callback == token);
        if self.callback(token).is_none() || is_anothers {
            return Status::NO_MATCH;
        }
        if let Some(client) = self.client(id) {
            client.callback = token;
        }
        Status::OK
    }

    fn register(&mut self, id: Id, function: Function) -> Status {
        let Some(client) = self.clients.iter_mut().find(|client| client.id == id) else { return Status::OK };
        if let Some(kind) = function.registers() {
            if !client.registered.contains(&kind) {
                client.registered.push(kind);
            }
            if kind == EventKind::Tick {
                client.ticks_lost_s = None;
                self.is_restart_wanted |= self.restarts_with_ticks;
            }
        }
        if let Some(kind) = function.unregisters() {
            client.registered.retain(|registered| *registered != kind);
            if kind == EventKind::Tick {
                client.ticks_lost_s = None;
            }
            let token = client.callback;
            if let Some(callback) = self.callback(token).filter(|_| kind == EventKind::Tick) {
                callback.tick = None;
            }
        }
        Status::OK
    }

    fn tell_events(&mut self) {
        let Self { controller, clients, callbacks, .. } = self;
        for event in controller.take_events() {
            for callback in &mut *callbacks {
                let is_wanted =
                    |kind| clients.iter().any(|client: &Client| client.takes(callback.token, kind));
                if event.kind().is_some_and(is_wanted) {
                    if callback.events.len() >= EVENTS {
                        callback.events.pop_front();
                    }
                    callback.events.push_back(event);
                }
            }
        }
    }

    fn push_ticks(&mut self) {
        if self.is_restart_wanted {
            return;
        }
        let pose = self.controller.pose();
        let Self { clients, callbacks, .. } = self;
        for callback in callbacks {
            if clients.iter().any(|client| client.takes(callback.token, EventKind::Tick)) {
                callback.tick = Some(pose);
            }
        }
    }

    /// Lands the flotor if a force command is no longer refreshed by its client.
    fn watch_silence(&mut self, dt_s: f64, log: &Log) {
        // A client waiting for a procedure cannot acknowledge ticks from the handler that made the call.
        if self.controller.is_busy() {
            return;
        }
        let opened = self.callbacks.iter_mut().filter_map(|callback| callback.tick_open_s.as_mut());
        let lost = self.clients.iter_mut().filter_map(|client| client.ticks_lost_s.as_mut());
        opened.chain(lost).for_each(|silent_s| *silent_s += dt_s);
        let commander = self.commander.and_then(|id| self.client(id));
        let (token, lost_s) = commander.map_or((None, None), |client| (client.callback, client.ticks_lost_s));
        let config = self.controller.config;
        let open_s = self.callback(token).and_then(|callback| callback.tick_open_s).or(lost_s).unwrap_or(0.0);
        let is_silent = open_s > config.watchdog_s && self.controller.is_driven_by_forces();
        if is_silent && config.silence == Silence::Lands {
            log(format_args!("landing why=silence silence_ms={:.0}", open_s * 1.0e3));
            self.controller.land();
        }
    }

    pub(super) fn log_changes(&mut self, log: &Log) {
        let now = (self.controller.flight, self.controller.faults);
        if now != self.reported {
            self.reported = now;
            log(format_args!("flight {:?} faults={} at_ms={:.0}", now.0, now.1, self.now_s * 1.0e3));
        }
    }

    pub(super) fn take_next(&mut self, token: Id) -> Option<Next> {
        let victim =
            self.clients.iter().find(|client| client.callback == Some(token)).map(|client| client.id);
        let is_silenced = victim.is_some_and(|victim| self.plan.has_silenced(victim));
        let Some(callback) = self.callbacks.iter_mut().find(|callback| callback.token == token) else {
            return Some(Next::End(CallbackEnd::Gone));
        };
        if let Some(end) = callback.end {
            return Some(Next::End(end));
        }
        if is_silenced {
            return None;
        }
        if let Some(event) = callback.events.pop_front() {
            return Some(Next::Event(event));
        }
        let tick = Event::Tick(callback.tick.take()?);
        callback.tick_open_s = Some(0.0);
        Some(if self.plan.delays_tick() { Next::LateTick(tick) } else { Next::Event(tick) })
    }
}
