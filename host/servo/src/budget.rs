//! Time budget of a model: a model with too many overruns is faded out and reported.

use super::clock::monotonic_ns;

/// Tolerated excess of slow ticks over ticks in time. A single slow tick is more likely the machine's fault than the model's; a
/// model that is slow in most ticks is soon disabled, even if never in many in a row.
const TOLERATED_OVERRUNS: u32 = 4;
/// Time over which a model with too many overruns fades out, ns. It is not stepped meanwhile: its last answer fades.
const FADE_NS: u64 = 50_000_000;

/// Permission to step a model, with the weight of its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Allowed {
    /// Step the model and use its whole answer.
    Asked,
    /// Do not step; weight of the last answer, above 0 and up to 1.
    Fading(f64),
    /// Disabled.
    Nothing,
}

/// Presence of an answer at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// Answered.
    There,
    /// No reply from a worker that timed out or is still at an earlier step.
    Missing,
}

/// Time budget of one model, with its overruns.
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

/// Overrun for which a model was disabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrun {
    /// Last tick in which the model was stepped.
    pub tick: u64,
    /// Longest step, ns.
    pub longest_ns: u64,
    /// Time limit of a step, ns.
    pub limit_ns: u64,
}

impl TimeBudget {
    /// Creates a budget with a time limit per step, ns, or without. Not real-time.
    pub fn new(limit_ns: Option<u64>) -> Self {
        Self { limit_ns, ..Self::default() }
    }

    /// Returns the permission to step the model at a time of the run. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn allowed(&self, now_ns: u64) -> Allowed {
        let Some((_, since_ns)) = self.disabled_at else { return Allowed::Asked };
        let elapsed_ns = now_ns.saturating_sub(since_ns);
        if elapsed_ns >= FADE_NS {
            return Allowed::Nothing;
        }
        Allowed::Fading(1.0 - elapsed_ns as f64 / FADE_NS as f64)
    }

    /// Returns the start of a step, ns; `None` if steps are not timed. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn begin(&self) -> Option<u64> {
        self.limit_ns.map(|_| monotonic_ns())
    }

    /// Records a step that began at [`Self::begin`]; returns true if it took too long. Real-time: bounded, no allocation.
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

    /// Returns the overrun for which the model was disabled, if there was one.
    pub(super) fn overrun(&self) -> Option<Overrun> {
        let ((tick, _), limit_ns) = (self.disabled_at?, self.limit_ns?);
        Some(Overrun { tick, longest_ns: self.longest_ns, limit_ns })
    }
}

#[cfg(test)]
mod tests;
