//! Numbers on their way to a new value: a person at a slider must not make the force jump.

use super::ParameterChange;
use flotor_core::ChangeOutcome;
use flotor_hal::Tick;

/// The longest step in time that a number is moved by at a tick, ns: a tick after missed ones does not make up for them.
const LONGEST_STEP_NS: u64 = 10_000_000;

/// How fast a number gets to a new value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Before the next tick.
    AtOnce,
    /// At a rate, from the value in force.
    Gradual {
        /// The value when the plugin was created, in the parameter's unit: where a number begins that has not changed since.
        from: f64,
        /// The parameter's unit per second.
        per_s: f64,
    },
}

/// A number the loop knows the value of.
#[derive(Clone, Copy, Debug)]
struct Known {
    plugin: u16,
    generation: u16,
    parameter: u32,
    value: f64,
    /// Where it is to be, and how fast it gets there, per second.
    goal: Option<(f64, f64)>,
}

impl Known {
    fn is_of(&self, change: &ParameterChange) -> bool {
        (self.plugin, self.generation, self.parameter) == (change.plugin, change.generation, change.parameter)
    }

    /// The value after a time, s.
    fn after(&self, dt_s: f64) -> Option<f64> {
        let (goal, per_s) = self.goal?;
        let (way, step) = (goal - self.value, per_s * dt_s);
        let is_there = way.abs() <= step || way.is_nan();
        Some(if is_there { goal } else { self.value + step.copysign(way) })
    }
}

/// The numbers that were changed, with those that are on their way.
pub(super) struct Movements {
    known: Vec<Known>,
    moving: usize,
}

impl Movements {
    /// For at most so many parameters. Not real-time.
    pub(super) fn with_room(parameters: usize) -> Self {
        Self { known: Vec::with_capacity(parameters), moving: 0 }
    }

    /// How many numbers are on their way. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn moving(&self) -> usize {
        self.moving
    }

    /// A change that came at once: a number that was on its way there stays. Real-time: bounded, no allocation.
    pub(super) fn note(&mut self, change: &ParameterChange, outcome: ChangeOutcome) {
        if outcome == ChangeOutcome::Applied {
            self.keep(change, change.value, None);
        }
    }

    /// A number has a new goal; false if there is no room to remember it. Real-time: bounded, no allocation.
    pub(super) fn begin(&mut self, change: &ParameterChange, from: f64, per_s: f64) -> bool {
        self.keep(change, from, Some((change.value, per_s)))
    }

    fn keep(&mut self, change: &ParameterChange, value: f64, goal: Option<(f64, f64)>) -> bool {
        let has_room = self.known.len() < self.known.capacity();
        if let Some(known) = self.known.iter_mut().find(|known| known.is_of(change)) {
            known.goal = goal;
            if goal.is_none() {
                known.value = value;
            }
        } else if has_room {
            let ParameterChange { plugin, generation, parameter, .. } = *change;
            self.known.push(Known { plugin, generation, parameter, value, goal });
        } else {
            return false;
        }
        self.count();
        true
    }

    /// Moves every number that is on its way by a tick; `apply` makes the change. Real-time: bounded by the numbers and
    /// `apply`, no allocation.
    pub(super) fn advance(&mut self, tick: &Tick, mut apply: impl FnMut(ParameterChange) -> ChangeOutcome) {
        let dt_s = tick.dt_ns.min(LONGEST_STEP_NS) as f64 * 1.0e-9;
        if self.moving == 0 || dt_s == 0.0 {
            return;
        }
        for known in &mut self.known {
            let Some(value) = known.after(dt_s) else { continue };
            let Known { plugin, generation, parameter, .. } = *known;
            let change = ParameterChange { plugin, generation, parameter, value, pace: Pace::AtOnce };
            match apply(change) {
                ChangeOutcome::Applied => known.value = value,
                // It stays where it is: the plugin takes no more of it.
                ChangeOutcome::Refused | ChangeOutcome::Broke => known.goal = None,
            }
            known.goal = known.goal.filter(|(goal, _)| *goal != known.value);
        }
        self.count();
    }

    /// A plugin was replaced: what is known of the one before is no longer so. Real-time: bounded, no allocation.
    pub(super) fn forget_others(&mut self, plugin: u16, generation: u16) {
        self.known.retain(|known| known.plugin != plugin || known.generation == generation);
        self.count();
    }

    fn count(&mut self) {
        self.moving = self.known.iter().filter(|known| known.goal.is_some()).count();
    }
}
