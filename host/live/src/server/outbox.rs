//! Outbox of one client: a queue of limited length, which drops new ticks (counted) and frames when full.

use crate::{Kind, frame, ticks_to_payload};
use flotor_core::demand::DemandRequest;
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, lock};
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Maximum number of pending ticks: four seconds at 1 kHz.
const MAX_TICKS: usize = 4096;
/// Maximum number of other pending frames; the newest change of each parameter is appended even beyond. A client that sends this
/// many requests and reads nothing gets no more answers.
const MAX_FRAMES: usize = 256;

/// Maximum number of ticks in a frame.
const MAX_TICKS_IN_A_FRAME: usize = 1024;

#[derive(Default)]
pub(super) struct Outbox {
    state: Mutex<State>,
    changed: Condvar,
}

/// Pending frame, other than ticks.
struct WaitingFrame {
    /// Number of pending ticks that are sent before the frame.
    ticks_before: usize,
    /// Content of a change; `None` for other frames.
    change: Option<Arc<Change>>,
    bytes: Vec<u8>,
}

#[derive(Default)]
struct State {
    /// Pending ticks, in order.
    ticks: Vec<TickRecord>,
    /// Other pending frames, in order: a change is sent before the first tick that uses it, and after the previous tick. Separate
    /// from the ticks, so that an earlier change of the same parameter is found without searching the many ticks.
    frames: VecDeque<WaitingFrame>,
    dropped: u64,
    /// Final frame, sent after all others.
    last: Option<Vec<u8>>,
    /// Interval of the sent ticks, in ticks; 0: none.
    every: u32,
    /// Request for the outputs of models, while the client watches.
    request: Option<DemandRequest>,
    /// Events of the ticks skipped since the last appended tick.
    passed: Events,
    is_closed: bool,
}

impl State {
    /// Appends a frame after all pending frames and ticks.
    fn append(&mut self, change: Option<Arc<Change>>, bytes: Vec<u8>) {
        let ticks_before = self.ticks.len();
        self.frames.push_back(WaitingFrame { ticks_before, change, bytes });
    }
}

impl Outbox {
    fn lock(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Starts appending every tick with an index that is a multiple of `every`, and stores the `request` for model outputs until
    /// ticks end.
    pub(super) fn want_ticks(&self, every: u32, request: DemandRequest) {
        let mut state = self.lock();
        (state.every, state.request) = (every, Some(request));
        state.ticks.reserve_exact(MAX_TICKS);
    }

    /// Appends no more ticks, and withdraws the request for model outputs.
    pub(super) fn want_no_ticks(&self) {
        let mut state = self.lock();
        (state.every, state.request) = (0, None);
    }

    pub(super) fn wants_ticks(&self) -> bool {
        self.lock().every > 0
    }

    /// Appends a tick if its index is a multiple of the interval, with the events of skipped ticks; without room, counts it as dropped.
    pub(super) fn tick(&self, record: &TickRecord) {
        let mut state = self.lock();
        if state.every == 0 || state.is_closed {
            return;
        }
        state.passed.insert(record.events);
        if !record.tick.is_multiple_of(u64::from(state.every)) {
            return;
        }
        if state.ticks.len() >= MAX_TICKS {
            state.dropped += 1;
            return;
        }
        let events = std::mem::take(&mut state.passed);
        state.ticks.push(TickRecord { events, ..*record });
        drop(state);
        self.changed.notify_one();
    }

    /// Appends a change. If the queue is full, removes the earliest pending change of the same parameter first; the newest change
    /// of each parameter is never dropped, so that a slow client ends up with the current values.
    pub(super) fn change(&self, change: Arc<Change>, frame: Vec<u8>) {
        self.update(|state| {
            if state.is_closed {
                return;
            }
            if state.frames.len() >= MAX_FRAMES {
                let is_same = |waiting: &WaitingFrame| {
                    waiting.change.as_ref().is_some_and(|earlier| earlier.is_of_the_same(&change))
                };
                if let Some(earliest) = state.frames.iter().position(is_same) {
                    state.frames.remove(earliest);
                }
            }
            state.append(Some(change), frame);
        });
    }

    /// Appends a frame other than a tick or a change; without room, drops the frame.
    pub(super) fn push(&self, frame: Vec<u8>) {
        self.update(|state| {
            if state.frames.len() < MAX_FRAMES && !state.is_closed {
                state.append(None, frame);
            }
        });
    }

    /// Sets the final frame and closes the outbox.
    pub(super) fn last(&self, frame: Vec<u8>) {
        self.update(|state| {
            if !state.is_closed {
                (state.last, state.is_closed) = (Some(frame), true);
            }
        });
    }

    /// Rejects all further frames; pending ones may still be sent.
    pub(super) fn close(&self) {
        self.update(|state| state.is_closed = true);
    }

    /// Changes the state and wakes the writer.
    fn update(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.lock());
        self.changed.notify_one();
    }

    pub(super) fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// Waits for `period`, or until the outbox is closed.
    pub(super) fn pause(&self, period: Duration) {
        let state = self.lock();
        let _ = self.changed.wait_timeout_while(state, period, |state| !state.is_closed);
    }

    /// Waits for pending frames, then removes and encodes all of them; `None` if the outbox is closed and empty.
    pub(super) fn take(&self) -> Option<Vec<u8>> {
        let mut state = self.lock();
        while state.ticks.is_empty() && state.frames.is_empty() {
            if state.is_closed {
                return state.last.take();
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let dropped = state.dropped;
        // The queue of ticks retains its capacity.
        let ticks: Vec<TickRecord> = state.ticks.drain(..).collect();
        let frames = std::mem::take(&mut state.frames);
        // Unlocked before the encoding, for which the next tick need not wait.
        drop(state);
        let (mut sent, mut batch) = (0, Vec::new());
        // Ticks share a frame as long as no other frame is between them.
        let mut send = |batch: &mut Vec<u8>, until: usize| {
            for some in ticks.get(sent..until).unwrap_or_default().chunks(MAX_TICKS_IN_A_FRAME) {
                batch.extend(frame(Kind::Ticks, &ticks_to_payload(dropped, some.iter())));
            }
            sent = until;
        };
        for WaitingFrame { ticks_before, bytes, .. } in frames {
            send(&mut batch, ticks_before);
            batch.extend(bytes);
        }
        send(&mut batch, ticks.len());
        Some(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frames, ticks_from_payload};
    use flotor_core::demand::ObserverDemand;
    use flotor_core::trace::RECORD_WORDS;
    use flotor_core::{ChangeOutcome, ChangeSubject};
    use flotor_hal::Demand;
    use flotor_sync::Words;
    use std::time::Instant;

    fn record(tick: u64, events: Events) -> TickRecord {
        TickRecord { tick, events, ..TickRecord::from_words(&[0; RECORD_WORDS]) }
    }

    fn nothing() -> DemandRequest {
        ObserverDemand::default().request(Demand::FORCE)
    }

    fn taken(outbox: &Outbox) -> (u64, Vec<TickRecord>) {
        let mut frames = Frames::default();
        frames.push(&outbox.take().expect("something waits"));
        let mut all = (0, Vec::new());
        while let Some((kind, payload)) = frames.take().expect("frames of our own") {
            assert_eq!(kind, Kind::Ticks);
            let (dropped, records) = ticks_from_payload(payload);
            all.0 = dropped;
            all.1.extend(records);
        }
        all
    }

    #[test]
    fn what_finds_no_room_is_dropped_and_counted() {
        let outbox = Outbox::default();
        outbox.tick(&record(0, Events::NONE));
        outbox.want_ticks(1, nothing());
        for tick in 0..5000 {
            outbox.tick(&record(tick, Events::NONE));
        }
        let (dropped, records) = taken(&outbox);
        assert_eq!((dropped, records.len()), (5000 - 4096, 4096), "the oldest stay: they are in order");
        outbox.last(vec![7]);
        assert_eq!((outbox.take(), outbox.take()), (Some(vec![7]), None));
        for _ in 0..1000 {
            outbox.push(vec![0; 10]);
        }
        assert_eq!(outbox.take(), None, "a closed one takes nothing in");
    }

    #[test]
    fn nothing_that_happens_between_two_ticks_is_lost() {
        let outbox = Outbox::default();
        outbox.want_ticks(10, nothing());
        for tick in 0..20 {
            outbox.tick(&record(tick, if tick == 7 { Events::BOUNDARY } else { Events::NONE }));
        }
        let (_, records) = taken(&outbox);
        let seen: Vec<_> = records.iter().map(|record| (record.tick, record.events)).collect();
        assert_eq!(seen, [(0, Events::NONE), (10, Events::BOUNDARY)]);
    }

    fn changed(parameter: &str, outcome: ChangeOutcome) -> Arc<Change> {
        Arc::new(Change {
            tick: 0,
            time_ns: 0,
            plugin: "spring".to_owned(),
            subject: ChangeSubject::Parameter,
            parameter: parameter.to_owned(),
            value: String::new(),
            number: 0.0,
            outcome,
            settings: Vec::new(),
        })
    }

    #[test]
    fn the_newest_change_of_each_parameter_is_never_dropped() {
        let outbox = Outbox::default();
        let number = |number: u32| frame(Kind::Change, &number.to_le_bytes());
        outbox.change(changed("turns", ChangeOutcome::Applied), number(1_000_000));
        for value in 0..10_000 {
            outbox.change(changed("gamma_n", ChangeOutcome::Applied), number(value));
        }
        outbox.change(changed("gamma_n", ChangeOutcome::Refused), number(2_000_000));
        for _ in 0..1000 {
            outbox.push(frame(Kind::Answer, b"{}"));
        }
        outbox.change(changed("wire_mm", ChangeOutcome::Applied), number(3_000_000));
        let mut frames = Frames::default();
        frames.push(&outbox.take().expect("something waits"));
        let mut seen = Vec::new();
        while let Some((kind, payload)) = frames.take().expect("frames of our own") {
            assert_eq!(kind, Kind::Change, "there was no room for answers");
            seen.push(u32::from_le_bytes(payload.try_into().expect("a number")));
        }
        assert_eq!(seen.first(), Some(&1_000_000), "the only change of its parameter");
        assert_eq!(seen[seen.len() - 3..], [9_999, 2_000_000, 3_000_000]);
        assert!(seen.len() <= MAX_FRAMES + 2, "{} frames wait", seen.len());
    }

    #[test]
    fn a_change_stays_between_the_ticks_it_came_between() {
        let outbox = Outbox::default();
        outbox.want_ticks(1, nothing());
        outbox.tick(&record(0, Events::NONE));
        outbox.tick(&record(1, Events::NONE));
        outbox.change(changed("gamma_n", ChangeOutcome::Applied), frame(Kind::Change, b"{}"));
        outbox.tick(&record(2, Events::NONE));
        let mut frames = Frames::default();
        frames.push(&outbox.take().expect("something waits"));
        let mut seen = Vec::new();
        while let Some((kind, payload)) = frames.take().expect("frames of our own") {
            let ticks = if kind == Kind::Ticks { ticks_from_payload(payload).1.len() } else { 0 };
            seen.push((kind, ticks));
        }
        assert_eq!(seen, [(Kind::Ticks, 2), (Kind::Change, 0), (Kind::Ticks, 1)]);
    }

    #[test]
    fn the_newest_change_stays_after_the_tick_before_it() {
        let outbox = Outbox::default();
        outbox.want_ticks(1, nothing());
        for tick in 0..1000 {
            outbox.change(changed("gamma_n", ChangeOutcome::Applied), frame(Kind::Change, b"{}"));
            outbox.tick(&record(tick, Events::NONE));
        }
        let mut frames = Frames::default();
        frames.push(&outbox.take().expect("something waits"));
        let mut seen = Vec::new();
        while let Some((kind, payload)) = frames.take().expect("frames of our own") {
            seen.push(if kind == Kind::Ticks { ticks_from_payload(payload).1.len() } else { 0 });
        }
        let newest = MAX_FRAMES;
        assert_eq!(seen.first(), Some(&(1000 - newest)), "ticks of the changes that found no room");
        assert_eq!(seen[1..], [0, 1].repeat(newest));
    }

    /// What a full outbox costs is the shortest of a few rounds, beside what it costs without ticks.
    #[test]
    fn a_change_without_room_costs_the_same_whatever_ticks_wait() {
        let shortest = |every: u32| {
            let rounds = (0..5).map(|_| {
                let outbox = Outbox::default();
                outbox.want_ticks(every, nothing());
                (0..MAX_TICKS as u64).for_each(|tick| outbox.tick(&record(tick, Events::NONE)));
                let message = changed("gamma_n", ChangeOutcome::Applied);
                let since = Instant::now();
                for _ in 0..1000 {
                    outbox.change(Arc::clone(&message), Vec::new());
                }
                since.elapsed()
            });
            rounds.min().expect("there are rounds")
        };
        let (with_ticks, without) = (shortest(1), shortest(0));
        assert!(with_ticks < 10 * without, "{with_ticks:?}, without ticks {without:?}");
    }
}
