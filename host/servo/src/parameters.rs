//! Parameter changes between two ticks, sent by other threads or scheduled by the scene.
//!
//! A change is applied at a tick boundary, before the device is read, so that every model of the tick uses it. Changes sent
//! together are applied together. Each change is reported before the record of its tick; a change that could not be reported is not
//! applied, so a recording contains every change.
//!
//! A number may be sent with a rate: the parameter then moves to the new value over many ticks, because a hand would feel a jump.
//! Each step is a change with its own report, so a replay needs no rate.

pub use flotor_core::parameter_change::{ChangeReport, PLUGIN, Pace, ParameterChange, WEIGHT};

use super::queue::queue;
use flotor_core::gradual::Movements;
use flotor_core::{ChangeOutcome, PluginIndex};
use flotor_hal::Tick;
use flotor_hal::abi::CallStatus;
use rtrb::{Consumer, Producer};

/// Capacity for pending changes from other threads.
const WAITING_CHANGES: usize = 256;

/// Converts the status of a call to the outcome of a change.
#[inline]
fn outcome(status: CallStatus) -> ChangeOutcome {
    match status {
        CallStatus::Ok => ChangeOutcome::Applied,
        CallStatus::Panicked => ChangeOutcome::Broke,
        CallStatus::OutOfRange | CallStatus::Unsupported | CallStatus::WrongPhase => ChangeOutcome::Refused,
    }
}

/// Parameter change scheduled for a time of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledChange {
    /// Time of the change, ns; applied before the first tick at this time or later.
    pub time_ns: u64,
    /// Change to apply.
    pub change: ParameterChange,
}

/// Sender of changes to the loop; room for 256 pending changes.
pub type ChangeSender = Producer<ParameterChange>;
/// Receiver of the loop's reports on changes.
pub type ReportReceiver = Consumer<ChangeReport>;

/// Loop side of parameter changes: the schedule, changes sent by other threads, gradual changes, and reports.
pub struct ParameterQueue {
    /// Scheduled changes in order of time.
    schedule: Box<[ScheduledChange]>,
    /// Index of the next scheduled change.
    next: usize,
    sent: Consumer<ParameterChange>,
    movements: Movements,
    reports: Producer<ChangeReport>,
}

/// Saved state of the schedule and of gradual changes.
pub(crate) struct SavedChanges {
    next: usize,
    movements: Movements,
}

impl ParameterQueue {
    /// Saves schedule and gradual changes. Not real-time.
    pub(crate) fn save(&self) -> SavedChanges {
        SavedChanges { next: self.next, movements: self.movements.save() }
    }

    /// Restores schedule and gradual changes, and drops sent changes that are not applied yet. Not real-time.
    pub(crate) fn restore(&mut self, saved: &SavedChanges) {
        self.next = saved.next;
        self.movements = saved.movements.save();
        while self.sent.pop().is_ok() {}
    }

    /// Creates a queue with a schedule; returns it with the sender of changes and the receiver of reports. Not real-time.
    ///
    /// `replacements`: number of model replacements for which to reserve reports, in addition to one for each scheduled change.
    pub fn new(
        mut schedule: Vec<ScheduledChange>,
        replacements: usize,
    ) -> (Self, ChangeSender, ReportReceiver) {
        schedule.sort_by_key(|scheduled| scheduled.time_ns); // stable: equal times keep the scene's order
        let (sender, sent) = queue(WAITING_CHANGES);
        // Room for the whole schedule and twice the pending changes, so that a scheduled change is never delayed.
        let (reports, receiver) = queue(schedule.len() + replacements + 2 * WAITING_CHANGES);
        let movements = Movements::with_room(schedule.len() + WAITING_CHANGES);
        (Self { schedule: schedule.into(), next: 0, sent, movements, reports }, sender, receiver)
    }

    /// Returns the number of sent changes that are not applied yet. Real-time: bounded, no allocation.
    #[inline]
    pub fn waiting(&mut self) -> usize {
        self.sent.slots()
    }

    /// Returns true if a scheduled, sent or gradual change is due at this tick. Real-time: bounded, no allocation.
    pub fn is_due(&self, tick: &Tick) -> bool {
        let is_scheduled = self.schedule.get(self.next).is_some_and(|due| due.time_ns <= tick.time_ns);
        is_scheduled || self.movements.moving() > 0 || !self.sent.is_empty()
    }

    /// Reports that a plugin was replaced, and ends gradual changes of its other generations. Real-time: bounded, no allocation.
    pub fn report_replaced(&mut self, tick: &Tick, plugin: PluginIndex, generation: u16) {
        self.movements.forget_others(plugin, generation);
        let value = f64::from(generation);
        let change = ParameterChange { plugin, generation, parameter: PLUGIN, value, pace: Pace::AtOnce };
        let _ = self.reports.push(ChangeReport::at(tick, change, ChangeOutcome::Applied));
    }

    /// Applies the scheduled changes that are due, oldest first, then at most `waiting` sent changes, and advances gradual changes.
    /// Reports each change that was applied or rejected; returns true if `apply` was called for a reported change.
    ///
    /// Real-time: bounded by the schedule, `waiting`, the gradual changes, and `apply`; no allocation.
    #[inline]
    pub fn apply_due(
        &mut self,
        tick: &Tick,
        waiting: usize,
        mut apply: impl FnMut(&ParameterChange) -> CallStatus,
    ) -> bool {
        let Self { schedule, next, sent, movements, reports } = self;
        let mut any = false;
        let mut take = |reports: &mut Producer<ChangeReport>, change: ParameterChange| {
            any = true;
            let outcome = outcome(apply(&change));
            // There is room: for the whole schedule always, and for sent changes by the check below.
            let _ = reports.push(ChangeReport::at(tick, change, outcome));
            outcome
        };
        while let Some(due) = schedule.get(*next).filter(|due| due.time_ns <= tick.time_ns) {
            let outcome = take(reports, due.change);
            movements.note(&due.change, outcome);
            *next += 1;
        }
        // Sent and gradual changes wait until the queue of reports has room for all of them.
        let left = schedule.len() - *next;
        if waiting > 0 && reports.slots() >= left + sent.buffer().capacity() {
            for change in (0..waiting).map_while(|_| sent.pop().ok()) {
                let Pace::Gradual { from, per_s } = change.pace else {
                    let outcome = take(reports, change);
                    movements.note(&change, outcome);
                    continue;
                };
                if !movements.begin(&change, from, per_s) {
                    let _ = reports.push(ChangeReport::at(tick, change, ChangeOutcome::Refused));
                }
            }
        }
        if reports.slots() >= left + movements.moving() {
            let report = |change, outcome| {
                any = true;
                let _ = reports.push(ChangeReport::at(tick, change, outcome));
            };
            movements.advance(tick, |change| outcome(apply(change)), report);
        }
        any
    }
}

#[cfg(test)]
mod tests;
