//! Gradual changes: numbers move to a new value at a rate, so that a user's slider does not make the force jump.

use crate::parameter_change::{Pace, ParameterChange};
use crate::{ChangeOutcome, PluginIndex};
use flotor_hal::Tick;

/// Longest time step of a movement in a tick, ns: missed ticks are not caught up.
const LONGEST_STEP_NS: u64 = 10_000_000;
/// Time for which a plugin may reject the next value before the movement ends, ns: the queue of an asynchronous model may be full
/// for a while, and two numbers may have to move together.
const PATIENCE_NS: u64 = 1_000_000_000;

/// Number with its value and movement.
#[derive(Clone, Copy, Debug)]
struct Known {
    plugin: PluginIndex,
    generation: u16,
    parameter: u32,
    value: f64,
    /// Target value and rate per second.
    goal: Option<(f64, f64)>,
    /// Time for which the next value has been refused, ns.
    refused_ns: u64,
}

impl Known {
    fn is_of(&self, change: &ParameterChange) -> bool {
        (self.plugin, self.generation, self.parameter) == (change.plugin, change.generation, change.parameter)
    }

    /// Returns the value after a time, s; `None` without a target.
    fn after(&self, dt_s: f64) -> Option<f64> {
        let (goal, per_s) = self.goal?;
        let (way, step) = (goal - self.value, per_s * dt_s);
        let is_there = way.abs() <= step || way.is_nan();
        Some(if is_there { goal } else { self.value + step.copysign(way) })
    }
}

/// Changed parameters with their values, including the parameters in a gradual change.
pub struct Movements {
    known: Vec<Known>,
    moving: usize,
}

impl Movements {
    /// Copies the list to memory of the same capacity. Not real-time.
    #[must_use]
    pub fn save(&self) -> Self {
        let mut copy = Self::with_room(self.known.capacity());
        copy.known.extend_from_slice(&self.known);
        Self { moving: self.moving, ..copy }
    }

    /// Creates an empty list with preallocated memory for `parameters` numbers. Not real-time.
    #[must_use]
    pub fn with_room(parameters: usize) -> Self {
        Self { known: Vec::with_capacity(parameters), moving: 0 }
    }

    /// Returns the number of movements. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn moving(&self) -> usize {
        self.moving
    }

    /// Records an applied change without a rate, which ends a movement of the number. Real-time: bounded, no allocation.
    pub fn note(&mut self, change: &ParameterChange, outcome: ChangeOutcome) {
        if outcome == ChangeOutcome::Applied {
            self.keep(change, change.value, None);
        }
    }

    /// Starts a movement from the number's recorded value, else from `from`; returns false if there is no room. Real-time: bounded,
    /// no allocation.
    pub fn begin(&mut self, change: &ParameterChange, from: f64, per_s: f64) -> bool {
        self.keep(change, from, Some((change.value, per_s)))
    }

    fn keep(&mut self, change: &ParameterChange, value: f64, goal: Option<(f64, f64)>) -> bool {
        let has_room = self.known.len() < self.known.capacity();
        if let Some(known) = self.known.iter_mut().find(|known| known.is_of(change)) {
            (known.goal, known.refused_ns) = (goal, 0);
            if goal.is_none() {
                known.value = value;
            }
        } else if has_room {
            let ParameterChange { plugin, generation, parameter, .. } = *change;
            self.known.push(Known { plugin, generation, parameter, value, goal, refused_ns: 0 });
        } else {
            return false;
        }
        self.count();
        true
    }

    /// Advances all movements by a tick: `apply` makes each change; `report` receives each change made, and each movement that
    /// ended short of its target. Real-time: bounded by the numbers and `apply`, no allocation.
    pub fn advance(
        &mut self,
        tick: &Tick,
        mut apply: impl FnMut(&ParameterChange) -> ChangeOutcome,
        mut report: impl FnMut(ParameterChange, ChangeOutcome),
    ) {
        let dt_s = tick.dt_ns.min(LONGEST_STEP_NS) as f64 * 1.0e-9;
        if self.moving == 0 || dt_s == 0.0 {
            return;
        }
        for known in &mut self.known {
            let Some(value) = known.after(dt_s) else { continue };
            let Known { plugin, generation, parameter, .. } = *known;
            let change = ParameterChange { plugin, generation, parameter, value, pace: Pace::AtOnce };
            let outcome = apply(&change);
            match outcome {
                ChangeOutcome::Applied => (known.value, known.refused_ns) = (value, 0),
                ChangeOutcome::Refused if known.refused_ns + tick.dt_ns < PATIENCE_NS => {
                    known.refused_ns += tick.dt_ns;
                    continue;
                }
                ChangeOutcome::Refused | ChangeOutcome::Broke => known.goal = None,
            }
            report(change, outcome);
            known.goal = known.goal.filter(|(goal, _)| *goal != known.value);
        }
        self.count();
    }

    /// Drops the numbers of a plugin's other generations after a replacement. Real-time: bounded, no allocation.
    pub fn forget_others(&mut self, plugin: PluginIndex, generation: u16) {
        self.known.retain(|known| known.plugin != plugin || known.generation == generation);
        self.count();
    }

    fn count(&mut self) {
        self.moving = self.known.iter().filter(|known| known.goal.is_some()).count();
    }
}
