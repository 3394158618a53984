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
mod tests {
    use super::*;

    const LIMIT_NS: u64 = 500;

    fn booked(steps_ns: &[u64]) -> TimeBudget {
        let mut budget = TimeBudget::new(Some(LIMIT_NS));
        for (tick, took_ns) in (0..).zip(steps_ns) {
            budget.book(*took_ns, LIMIT_NS, tick, tick * 1_000_000);
        }
        budget
    }

    #[test]
    fn five_overruns_in_a_row_are_too_many_and_four_are_not() {
        assert_eq!(booked(&[501; 4]).overrun(), None);
        let overrun = Overrun { tick: 4, longest_ns: 900, limit_ns: LIMIT_NS };
        assert_eq!(booked(&[501, 501, 900, 501, 501]).overrun(), Some(overrun));
    }

    #[test]
    fn a_step_in_time_makes_up_for_one_that_was_not() {
        let one_in_two: Vec<u64> = (0..1000).map(|tick| 500 + tick % 2).collect();
        assert_eq!(booked(&one_in_two).overrun(), None);
        // Two in three gain one in three ticks.
        let two_in_three: Vec<u64> = (0..1000).map(|tick| 500 + u64::from(tick % 3 > 0)).collect();
        assert_eq!(booked(&two_in_three).overrun().map(|overrun| overrun.tick), Some(11));
    }

    #[test]
    fn who_is_slow_in_four_ticks_of_five_is_out_soon() {
        let steps: Vec<u64> = (0..100).map(|tick| if tick % 5 == 4 { 10 } else { 3_000_000 }).collect();
        assert_eq!(booked(&steps).overrun().map(|overrun| overrun.tick), Some(6));
    }

    #[test]
    fn who_is_out_fades_and_is_not_asked() {
        let budget = booked(&[501; 5]); // out at 4 ms
        assert_eq!(budget.allowed(4_000_000), Allowed::Fading(1.0));
        assert_eq!(budget.allowed(29_000_000), Allowed::Fading(0.5));
        assert_eq!(budget.allowed(54_000_000), Allowed::Nothing);
    }

    #[test]
    fn a_missing_answer_is_late_however_soon_that_was_known() {
        let mut budget = TimeBudget::new(Some(u64::MAX - 1));
        let begun_ns = monotonic_ns();
        assert!(!budget.end(begun_ns, Answer::There, 0, 0));
        assert!((1..=5).all(|tick| budget.end(begun_ns, Answer::Missing, tick, 0)));
        assert_eq!(budget.overrun().map(|overrun| overrun.tick), Some(5));
    }

    #[test]
    fn without_a_limit_nobody_looks_at_the_clock() {
        let mut budget = TimeBudget::new(None);
        assert_eq!(budget.begin(), None);
        assert!((0..100).all(|tick| !budget.end(0, Answer::Missing, tick, tick)));
        assert_eq!(budget.allowed(u64::MAX), Allowed::Asked);
    }
}
