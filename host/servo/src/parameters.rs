//! Changes of parameters between two ticks: what other threads sent, and what the scene has scheduled.
//!
//! A change is applied at a tick boundary, before the device is read, so that every model of the tick sees it.
//! Changes that were sent together are applied together. For each one a report goes out, ahead of the record of
//! its tick; nothing is ever applied that could not be reported, so a recording holds every change.
//!
//! A number may be sent with a rate: it then moves to its new value over many ticks, because a hand feels a jump. Each step is
//! a change with a report of its own, so a replay needs no rate.

mod gradual;

pub use gradual::Pace;

use super::queue::queue;
use flotor_core::ChangeOutcome;
use flotor_hal::Tick;
use flotor_hal::abi::CallStatus;
use gradual::Movements;
use rtrb::{Consumer, Producer};

/// Changes other threads may have waiting at a time.
const WAITING_CHANGES: usize = 256;

/// Stands for the weight of a model where a parameter is named.
pub const WEIGHT: u32 = u32::MAX;
/// Stands for the plugin itself where a parameter is named.
pub const PLUGIN: u32 = u32::MAX - 1;

/// A new value for a parameter. The numbers come from a schema: see `session::Controls`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterChange {
    /// Number of the plugin in the run: the devices, then the models, both in the scene's order.
    pub plugin: u16,
    /// How often the plugin was replaced when the change was made: a change is for what it was checked against.
    pub generation: u16,
    /// Index into the plugin's schema, [`WEIGHT`], or in a report [`PLUGIN`].
    pub parameter: u32,
    /// The value; for a choice, its index.
    pub value: f64,
    /// How fast it gets there.
    pub pace: Pace,
}

/// What became of a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeReport {
    /// The tick it was applied before.
    pub tick: u64,
    /// The time of that tick, ns.
    pub time_ns: u64,
    /// The change.
    pub change: ParameterChange,
    /// What the plugin made of it.
    pub outcome: ChangeOutcome,
}

/// What a call says about a change.
#[inline]
fn outcome(status: CallStatus) -> ChangeOutcome {
    match status {
        CallStatus::Ok => ChangeOutcome::Applied,
        CallStatus::Panicked => ChangeOutcome::Broke,
        CallStatus::OutOfRange | CallStatus::Unsupported | CallStatus::WrongPhase => ChangeOutcome::Refused,
    }
}

/// A change at a time that was known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledChange {
    /// Applied before the first tick at this time or later, ns.
    pub time_ns: u64,
    /// The change.
    pub change: ParameterChange,
}

/// Where changes are sent in.
pub type ChangeSender = Producer<ParameterChange>;
/// Where reports come out.
pub type ReportReceiver = Consumer<ChangeReport>;

/// The loop's end of it.
pub struct ParameterQueue {
    /// In order of time.
    schedule: Box<[ScheduledChange]>,
    /// The next of the schedule.
    next: usize,
    sent: Consumer<ParameterChange>,
    movements: Movements,
    reports: Producer<ChangeReport>,
}

impl ParameterQueue {
    /// A queue with a schedule; where changes are sent in, and where reports come out. Not real-time.
    ///
    /// `replacements` is the number of reports beside those of the schedule that must find room.
    pub fn new(
        mut schedule: Vec<ScheduledChange>,
        replacements: usize,
    ) -> (Self, ChangeSender, ReportReceiver) {
        schedule.sort_by_key(|scheduled| scheduled.time_ns); // stable: equal times keep the scene's order
        let (sender, sent) = queue(WAITING_CHANGES);
        // Room for the whole schedule and for twice what may wait, so that what is scheduled is never delayed.
        let (reports, receiver) = queue(schedule.len() + replacements + 2 * WAITING_CHANGES);
        let movements = Movements::with_room(schedule.len() + WAITING_CHANGES);
        (Self { schedule: schedule.into(), next: 0, sent, movements, reports }, sender, receiver)
    }

    /// How many changes wait at this moment. Real-time: bounded, no allocation.
    #[inline]
    pub fn waiting(&mut self) -> usize {
        self.sent.slots()
    }

    /// Whether anything is to be applied at this tick. Real-time: bounded, no allocation.
    pub fn is_due(&self, tick: &Tick) -> bool {
        let is_scheduled = self.schedule.get(self.next).is_some_and(|due| due.time_ns <= tick.time_ns);
        is_scheduled || self.movements.moving() > 0 || !self.sent.is_empty()
    }

    /// Reports that a plugin was replaced. Real-time: bounded, no allocation.
    pub fn report_replaced(&mut self, tick: &Tick, plugin: u16, generation: u16) {
        self.movements.forget_others(plugin, generation);
        let value = f64::from(generation);
        let change = ParameterChange { plugin, generation, parameter: PLUGIN, value, pace: Pace::AtOnce };
        let _ = self.reports.push(ChangeReport {
            tick: tick.index,
            time_ns: tick.time_ns,
            change,
            outcome: ChangeOutcome::Applied,
        });
    }

    /// Applies what is due at this tick, oldest first, and at most `waiting` of those that were sent, and moves numbers on
    /// that have a rate; reports it; true if there was anything.
    ///
    /// Real-time: bounded by the schedule, `waiting`, the numbers that move, and `apply`; no allocation.
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
            // It fits: the queue has room for the schedule, and the rest is only looked at when all of it does.
            let _ = reports.push(ChangeReport { tick: tick.index, time_ns: tick.time_ns, change, outcome });
            outcome
        };
        while let Some(due) = schedule.get(*next).filter(|due| due.time_ns <= tick.time_ns) {
            let outcome = take(reports, due.change);
            movements.note(&due.change, outcome);
            *next += 1;
        }
        // The queue of reports must have room for what was sent; else that waits, and so do the numbers that move.
        let left = schedule.len() - *next;
        if waiting > 0 && reports.slots() >= left + sent.buffer().capacity() {
            for change in (0..waiting).map_while(|_| sent.pop().ok()) {
                let Pace::Gradual { from, per_s } = change.pace else {
                    let outcome = take(reports, change);
                    movements.note(&change, outcome);
                    continue;
                };
                if !movements.begin(&change, from, per_s) {
                    let (tick, time_ns, outcome) = (tick.index, tick.time_ns, ChangeOutcome::Refused);
                    let _ = reports.push(ChangeReport { tick, time_ns, change, outcome });
                }
            }
        }
        if reports.slots() >= left + movements.moving() {
            let report = |change, outcome| {
                any = true;
                let _ =
                    reports.push(ChangeReport { tick: tick.index, time_ns: tick.time_ns, change, outcome });
            };
            movements.advance(tick, |change| outcome(apply(change)), report);
        }
        any
    }
}

#[cfg(test)]
mod tests;
