//! State shared by connections and servo loop: the controller, the clients, pending events.

use super::state::{Callback, CallbackEnd, Client, EVENTS, Id, Log, Next, State};
use crate::controller::Sample;
use crate::ml_api::controller::{Answer, Controller, Flight, ProcedureId, Silence, is_command};
use crate::ml_api::injected_fault::{Deed, InjectedFault, Plan};
use flotor_hal::Wrench;
use flotor_maglev::ml_api::{EventKind, InvalidRequest, Reply, Request};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Age of an unacknowledged tick beyond which the loop no longer waits for it, s.
const GIVEN_UP_S: f64 = 0.06;

/// State shared by the connections and the servo loop, behind one lock.
pub struct Hub {
    state: Mutex<State>,
    changed: Condvar,
    log: Log,
}

/// Result of a call: treatment and answer.
pub(super) struct Handled {
    pub(super) deed: Deed,
    pub(super) answer: Answer,
}

impl Hub {
    /// Creates a hub without clients. `restarts_with_ticks`: registering for ticks restarts the plant.
    #[must_use]
    pub fn new(
        controller: Controller,
        injected_faults: Vec<InjectedFault>,
        restarts_with_ticks: bool,
        log: Log,
    ) -> Self {
        let state = State::new(controller, Plan::new(injected_faults), restarts_with_ticks);
        Self { state: Mutex::new(state), changed: Condvar::new(), log }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Poisoning is ignored: no invariant spans two values.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    // ------------------------------------------------------------ servo loop

    /// Returns the servo interval, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1.0 / self.state().controller.servo_hz()
    }

    /// Returns true once after a request to restart the plant.
    #[must_use]
    pub fn takes_restart(&self) -> bool {
        std::mem::take(&mut self.state().is_restart_wanted)
    }

    /// Begins a servo interval of `dt_s`: stores its first sample, advances injected faults and procedures, queues events for
    /// clients, and lands the flotor after the loss of a client's acknowledgements.
    pub fn begin(&self, sample: &Sample, dt_s: f64) {
        self.state().begin(sample, dt_s, &self.log);
        self.changed.notify_all();
    }

    /// Runs a whole servo interval of `dt_s` without waiting for the lock, and returns the wrench over the interval and the current of
    /// the grasp, A; `None` if a connection holds the lock. Real-time: bounded, no allocation; one system call.
    #[must_use]
    pub fn try_cycle(&self, sample: &Sample, dt_s: f64) -> Option<(Wrench, f64)> {
        let mut state = self.state.try_lock().ok()?;
        state.begin(sample, dt_s, &self.log);
        let driven = (state.controller.drive(dt_s), state.controller.grasp_a());
        drop(state);
        self.changed.notify_all();
        Some(driven)
    }

    /// Advances the coil temperatures and the integral terms by a servo interval of `dt_s`, and returns the wrench over the
    /// interval.
    #[must_use]
    pub fn drive(&self, dt_s: f64) -> Wrench {
        self.state().controller.drive(dt_s)
    }

    /// Stores a sample without beginning an interval.
    pub fn observe(&self, sample: &Sample) {
        self.state().controller.observe(sample);
    }

    /// Waits until all ticks are acknowledged by the clients that respond, or until the timeout; returns at once if no client is
    /// registered for ticks.
    #[must_use]
    pub fn wait_for_ticks_taken(&self, patience: Duration) -> TickWait {
        let taken = self.wait(patience, |state| {
            let mut wanted = state.clients.iter().filter(|client| client.wants(EventKind::Tick)).peekable();
            if wanted.peek().is_none() {
                return Some(if state.controller.is_busy() { TickWait::Busy } else { TickWait::Unwanted });
            }
            let open = wanted.any(|client| {
                let callback =
                    state.callbacks.iter().find(|callback| client.callback == Some(callback.token));
                callback.is_some_and(|callback| {
                    callback.tick_open_s.map_or(callback.tick.is_some(), |open_s| open_s < GIVEN_UP_S)
                })
            });
            (!open).then_some(TickWait::Taken)
        });
        taken.unwrap_or(TickWait::Open)
    }

    /// Waits until `found` returns a value for the state, which is tried again after each change; `None` on timeout.
    fn wait<T>(&self, patience: Duration, mut found: impl FnMut(&mut State) -> Option<T>) -> Option<T> {
        let until = Instant::now() + patience;
        let mut state = self.state();
        loop {
            let value = found(&mut state);
            let rest = until.saturating_duration_since(Instant::now());
            if value.is_some() || rest.is_zero() {
                return value;
            }
            state = self.changed.wait_timeout(state, rest).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    // ------------------------------------------------------------ control connections

    pub(super) fn connect(&self, from: &str) -> Id {
        let mut state = self.state();
        let id = state.next_id;
        state.next_id += 1;
        state.clients.push(Client { id, callback: None, registered: Vec::new(), ticks_lost_s: None });
        drop(state);
        (self.log)(format_args!("connected {from} client={id}"));
        id
    }

    /// Removes a client; lands the flotor if this client commanded it, unless the loss of a client is ignored ([`Silence`]).
    pub(super) fn disconnect(&self, id: Id) {
        let mut state = self.state();
        let Some(place) = state.clients.iter().position(|client| client.id == id) else { return };
        let client = state.clients.remove(place);
        if let Some(callback) = state.callback(client.callback) {
            callback.end.get_or_insert(CallbackEnd::Gone);
        }
        if state.commander == Some(id) {
            state.commander = None;
            let lands = state.controller.config.silence == Silence::Lands;
            if lands && matches!(state.controller.flight, Flight::TakingOff | Flight::Flying) {
                (self.log)(format_args!("landing why=client-lost client={id}"));
                state.controller.land();
            }
        }
        state.log_changes(&self.log);
        drop(state);
        self.changed.notify_all();
        (self.log)(format_args!("closed client={id}"));
    }

    /// Handles a decoded request, or the error of an invalid one.
    pub(super) fn handle(&self, id: Id, request: Result<Request, InvalidRequest>) -> Handled {
        let mut state = self.state();
        let deed = state.plan.deed(id);
        // No thread waits for a command: waking the servo loop would delay the reply.
        let wakes = deed != Deed::Answer || !request.is_ok_and(|request| is_command(request.function()));
        let answer = match (deed, request) {
            (Deed::Status(status), request) => {
                let function =
                    request.map_or_else(|unreadable| unreadable.function, |request| Some(request.function()));
                Answer::Now(Reply::failed(function, status))
            }
            (_, Err(unreadable)) => Answer::Now(Reply::failed(unreadable.function, unreadable.status)),
            (_, Ok(request)) => state.execute(id, &request),
        };
        if deed == Deed::Close || deed == Deed::Reset {
            let end = if deed == Deed::Close { CallbackEnd::Close } else { CallbackEnd::Gone };
            let token =
                state.clients.iter().find(|client| client.id == id).and_then(|client| client.callback);
            if let Some(callback) = state.callback(token) {
                callback.end = Some(end);
            }
        }
        state.log_changes(&self.log);
        drop(state);
        if wakes {
            self.changed.notify_all();
        }
        Handled { deed, answer }
    }

    /// Waits for the reply of a procedure; `None` on timeout.
    pub(super) fn wait_for_reply(&self, procedure_id: ProcedureId, patience: Duration) -> Option<Reply> {
        self.wait(patience, |state| state.controller.reply(procedure_id))
    }

    // ------------------------------------------------------------ callback connections

    /// Turns a client into a callback connection and returns its token.
    pub(super) fn becomes_callback(&self, id: Id) -> Id {
        let mut state = self.state();
        state.clients.retain(|client| client.id != id);
        if state.commander == Some(id) {
            state.commander = None;
        }
        state.callbacks.push(Callback {
            token: id,
            events: VecDeque::with_capacity(EVENTS),
            tick: None,
            tick_open_s: None,
            end: None,
        });
        id
    }

    /// Waits for the next event to send; `None` on timeout.
    pub(super) fn next(&self, token: Id, patience: Duration) -> Option<Next> {
        self.wait(patience, |state| state.take_next(token))
    }

    /// Marks the last tick as acknowledged.
    pub(super) fn acknowledged(&self, token: Id) {
        if let Some(callback) = self.state().callback(Some(token)) {
            callback.tick_open_s = None;
        }
        self.changed.notify_all();
    }

    /// Returns the reason to close the callback connection without an end event; `None` if the connection stays open or an end
    /// event is pending.
    pub(super) fn is_over(&self, token: Id) -> Option<CallbackEnd> {
        let mut state = self.state();
        state
            .callback(Some(token))
            .map_or(Some(CallbackEnd::Gone), |callback| callback.end.filter(|end| *end != CallbackEnd::Asked))
    }

    /// Removes a callback connection and the registrations of its client.
    pub(super) fn callback_gone(&self, token: Id) {
        let mut state = self.state();
        state.callbacks.retain(|callback| callback.token != token);
        for client in state.clients.iter_mut().filter(|client| client.callback == Some(token)) {
            client.callback = None;
            client.ticks_lost_s = client.registered.contains(&EventKind::Tick).then_some(0.0);
            client.registered.clear();
        }
        drop(state);
        self.changed.notify_all();
    }
}

/// Result of a wait for acknowledgements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickWait {
    /// No client is registered for ticks, and a procedure is in progress.
    Busy,
    /// No client is registered for ticks.
    Unwanted,
    /// All ticks are acknowledged, or older than 60 ms.
    Taken,
    /// A tick is still unacknowledged.
    Open,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ml_api::controller::ControllerConfig;

    #[test]
    fn a_tick_that_nobody_answers_is_waited_for_for_a_while() {
        let controller = Controller::new(ControllerConfig::default());
        let hub = Hub::new(controller, Vec::new(), false, Box::new(|_| ()));
        let client = hub.connect("here");
        let token = hub.becomes_callback(hub.connect("here"));
        let map = Request::MapToken(i32::try_from(token).expect("a small number"));
        for request in [map, Request::register(EventKind::Tick, 1)] {
            let _ = hub.handle(client, Ok(request));
        }
        let interval = || hub.begin(&Sample::HOME, 1.0e-3);
        interval();
        assert!(hub.next(token, Duration::ZERO).is_some(), "a tick is sent");
        for _ in 0..50 {
            interval();
            assert_eq!(hub.wait_for_ticks_taken(Duration::ZERO), TickWait::Open);
        }
        (0..20).for_each(|_| interval());
        assert_eq!(hub.wait_for_ticks_taken(Duration::ZERO), TickWait::Taken);
        // The next one is waited for again.
        hub.acknowledged(token);
        assert_eq!(hub.wait_for_ticks_taken(Duration::ZERO), TickWait::Open);
    }
}
