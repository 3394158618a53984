//! The time a model may take: who overruns it again and again is faded out and named.

use super::clock::monotonic_ns;

/// How many more ticks a model may be too slow than in time, since it last made up for all: one alone is more likely the
/// machine's fault than the model's, but one that is slow in most ticks is out soon, also if never in many in a row.
const TOLERATED_OVERRUNS: u32 = 4;
/// Time over which a model that took too long fades out, ns. It is not asked meanwhile: its last answer fades.
const FADE_NS: u64 = 50_000_000;

/// How much of a model's answer is used, and whether it is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Allowed {
    /// It is asked, and all of its answer is used.
    Asked,
    /// It is not asked; this much of its last answer is used, above 0 and up to 1.
    Fading(f64),
    /// It is out.
    Nothing,
}

/// Whether there was an answer at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// There was.
    There,
    /// A process that was waited for, or is still at an earlier step, had none.
    Missing,
}

/// The time one model may take, and how it keeps to it.
#[derive(Clone, Debug, Default)]
pub struct TimeBudget {
    /// `None`: nobody looks at the clock.
    limit_ns: Option<u64>,
    /// Ticks in which it was too slow less those in which it was not; never below zero.
    overruns: u32,
    /// Tick and time at which the model was taken out.
    out_at: Option<(u64, u64)>,
    longest_ns: u64,
}

/// A model that was too slow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrun {
    /// The tick after which it was not asked any more.
    pub tick: u64,
    /// The longest step it took, ns.
    pub longest_ns: u64,
    /// What it may take, ns.
    pub limit_ns: u64,
}

impl TimeBudget {
    /// A budget of so many ns a step, or none. Not real-time.
    pub fn new(limit_ns: Option<u64>) -> Self {
        Self { limit_ns, ..Self::default() }
    }

    /// Whether the model is to be asked at a time of the run. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn allowed(&self, now_ns: u64) -> Allowed {
        let Some((_, since_ns)) = self.out_at else { return Allowed::Asked };
        let elapsed_ns = now_ns.saturating_sub(since_ns);
        if elapsed_ns >= FADE_NS {
            return Allowed::Nothing;
        }
        Allowed::Fading(1.0 - elapsed_ns as f64 / FADE_NS as f64)
    }

    /// When a step begins, ns; `None` if nobody looks at the clock. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn begin(&self) -> Option<u64> {
        self.limit_ns.map(|_| monotonic_ns())
    }

    /// Books a step that began at [`Self::begin`]; true if it took too long. Real-time: bounded, no allocation.
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
            self.out_at.get_or_insert((tick, now_ns));
        }
        true
    }

    /// How the model was too slow, if it was taken out.
    pub(super) fn overrun(&self) -> Option<Overrun> {
        let ((tick, _), limit_ns) = (self.out_at?, self.limit_ns?);
        Some(Overrun { tick, longest_ns: self.longest_ns, limit_ns })
    }
}

#[cfg(test)]
mod tests;
