//! Time budget of a model: a model with too many overruns is faded out and reported.

use super::clock::monotonic_ns;
use flotor_core::health::Overrun;

/// Tolerated excess of slow ticks over ticks in time. A single slow tick is more likely caused by the machine than by the model; a
/// model that is slow in most ticks is soon disabled, even without many slow ticks in a row.
const TOLERATED_OVERRUNS: u32 = 4;
/// Time over which a model with too many overruns fades out, ns. The model is not stepped meanwhile: its last output fades.
const FADE_NS: u64 = 50_000_000;

/// Permission to step a model, with the weight of its output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Allowed {
    /// Step the model and use its output in full.
    Asked,
    /// Do not step the model; use its last output with this weight, above 0 and up to 1.
    Fading(f64),
    /// Do not step the model: it is disabled.
    Nothing,
}

/// Presence of an output at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// Output received.
    There,
    /// No reply: a worker has timed out or is still busy with an earlier step.
    Missing,
}

/// Time limit of a model's steps, with a count of the overruns.
#[derive(Clone, Debug, Default)]
pub struct TimeBudget {
    /// Time limit of a step, ns; `None`: steps are not timed.
    limit_ns: Option<u64>,
    /// Slow ticks less ticks in time; never below zero.
    overruns: u32,
    /// Tick and time at which the model was disabled.
    disabled_at: Option<(u64, u64)>,
    longest_ns: u64,
}

impl TimeBudget {
    /// Creates a budget with a time limit per step, ns; `None`: steps are not timed. Not real-time.
    pub fn new(limit_ns: Option<u64>) -> Self {
        Self { limit_ns, ..Self::default() }
    }

    /// Returns the permission to step the model at the run time `now_ns`. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn allowed(&self, now_ns: u64) -> Allowed {
        let Some((_, since_ns)) = self.disabled_at else { return Allowed::Asked };
        let elapsed_ns = now_ns.saturating_sub(since_ns);
        if elapsed_ns >= FADE_NS {
            return Allowed::Nothing;
        }
        Allowed::Fading(1.0 - elapsed_ns as f64 / FADE_NS as f64)
    }

    /// Returns the start time of a step on the monotonic clock, ns; `None` if steps are not timed. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn begin(&self) -> Option<u64> {
        self.limit_ns.map(|_| monotonic_ns())
    }

    /// Records the duration of a step since `begun_ns`, the result of [`Self::begin`]; returns true if the step exceeded the limit
    /// or has no output. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn end(&mut self, begun_ns: u64, answer: Answer, tick: u64, now_ns: u64) -> bool {
        let Some(limit_ns) = self.limit_ns else { return false };
        let took_ns = monotonic_ns() - begun_ns;
        let least_ns = if answer == Answer::Missing { limit_ns.saturating_add(1) } else { 0 };
        self.book(took_ns.max(least_ns), limit_ns, tick, now_ns)
    }

    fn book(&mut self, took_ns: u64, limit_ns: u64, tick: u64, now_ns: u64) -> bool {
        self.longest_ns = self.longest_ns.max(took_ns);
        if took_ns <= limit_ns {
            self.overruns = self.overruns.saturating_sub(1);
            return false;
        }
        self.overruns += 1;
        if self.overruns > TOLERATED_OVERRUNS {
            self.disabled_at.get_or_insert((tick, now_ns));
        }
        true
    }

    /// Returns the overrun for which the model was disabled; `None` if the model is not disabled.
    pub(super) fn overrun(&self) -> Option<Overrun> {
        let ((tick, _), limit_ns) = (self.disabled_at?, self.limit_ns?);
        Some(Overrun { tick, longest_ns: self.longest_ns, limit_ns })
    }
}

#[cfg(test)]
mod tests;
