//! How long things take within a tick, from the processor's own counter of time.
//!
//! The system's clock is read by an instruction that waits until all before it is done, and lets nothing after it begin:
//! it costs a tick twice what the reading itself takes. The counter is read on the way. How fast it counts is measured once,
//! against the system's clock; where a processor has none that is steady, the system's clock it is.
//!
//! `quanta` measures that, too, but trusts its first pair of readings: a process put aside for 4 ms between the two is told
//! times 2 % wrong as long as it lives. Here each reading of the counter lies between two of the clock, which says how far
//! it is to be trusted, and the measurement goes on until that is far enough.
//!
//! Deadlines and lateness are the system's clock's alone (`clock.rs`).

use std::sync::OnceLock;

use quanta::Clock;

use super::clock::monotonic_ns;

/// A place on the counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moment(u64);

/// Reads the counter.
pub(super) struct Stopwatch {
    counter: Clock,
    count: CountLength,
}

impl Stopwatch {
    /// Not real-time: the first one of a process measures how fast the counter is, for some 10 ms, 0.4 s at most.
    pub(super) fn new() -> Self {
        static COUNT: OnceLock<CountLength> = OnceLock::new();
        let counter = Clock::new();
        let count = *COUNT.get_or_init(|| CountLength::measured(|| Look::at(&counter)));
        Self { counter, count }
    }

    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn now(&self) -> Moment {
        Moment(self.counter.raw())
    }

    /// Time from one moment to another, ns; 0 if the other was before it. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn between_ns(&self, from: Moment, to: Moment) -> u64 {
        self.count.times_ns(to.0.saturating_sub(from.0))
    }
}

/// The counter, read between two readings of the clock.
#[derive(Clone, Copy)]
struct Look {
    before_ns: u64,
    count: u64,
    after_ns: u64,
}

impl Look {
    fn at(counter: &Clock) -> Self {
        Self { before_ns: monotonic_ns(), count: counter.raw(), after_ns: monotonic_ns() }
    }

    /// Within so many ns the clock's time at the count is unknown.
    fn doubt_ns(self) -> u64 {
        self.after_ns - self.before_ns
    }
}

/// How long one count lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountLength {
    /// In 2⁻³² ns: for a counter of 10 GHz still finer than it is measured.
    parts: u64,
}

impl CountLength {
    const PARTS_PER_NS_LOG2: u32 = 32;
    /// The measurement ends where it can be wrong by so much, relative: a hundredth of what the histograms tell apart (two
    /// digits, `timing.rs`). An idle machine gets there in a millisecond.
    const ENOUGH: f64 = 100e-6;
    /// Where it ends in any case, with the best there was, ns: as long as `quanta` takes at most.
    const LONGEST_NS: u64 = 200_000_000;
    /// Of so many looks at its beginning the one that leaves least in doubt counts.
    const FIRST_LOOKS: usize = 32;

    /// Not real-time.
    fn measured(mut look: impl FnMut() -> Look) -> Self {
        let mut first = look();
        for _ in 1..Self::FIRST_LOOKS {
            let next = look();
            first = if next.doubt_ns() < first.doubt_ns() { next } else { first };
        }
        let (mut least_doubt, mut best) = (f64::INFINITY, Self { parts: 0 });
        loop {
            let last = look();
            // From the middle of the one look to the middle of the other, twice.
            let twice_ns = (last.before_ns - first.before_ns) + (last.after_ns - first.after_ns);
            let doubt = (first.doubt_ns() + last.doubt_ns()) as f64 / twice_ns as f64;
            if doubt < least_doubt {
                (least_doubt, best) = (doubt, Self::of(twice_ns, 2 * (last.count - first.count).max(1)));
            }
            if least_doubt <= Self::ENOUGH || twice_ns / 2 >= Self::LONGEST_NS {
                return best;
            }
        }
    }

    /// So many counts in so many ns.
    #[allow(clippy::cast_possible_truncation)] // some 2³², or the counter is slower than a clock on the wall
    fn of(ns: u64, counts: u64) -> Self {
        Self { parts: ((u128::from(ns) << Self::PARTS_PER_NS_LOG2) / u128::from(counts)) as u64 }
    }

    /// Real-time: bounded, no allocation.
    #[inline]
    #[allow(clippy::cast_possible_truncation)] // 2⁶⁴ ns are 584 years
    fn times_ns(self, counts: u64) -> u64 {
        ((u128::from(counts) * u128::from(self.parts)) >> Self::PARTS_PER_NS_LOG2) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor that takes 25 ns for every reading, counts at 2.5 GHz and is put aside for a while before those readings.
    struct Processor<'a> {
        now_ns: u64,
        readings: usize,
        aside: &'a dyn Fn(usize) -> u64,
    }

    impl Processor<'_> {
        fn read_ns(&mut self) -> u64 {
            self.now_ns += 25 + (self.aside)(self.readings);
            self.readings += 1;
            self.now_ns
        }

        fn measured(aside: &dyn Fn(usize) -> u64) -> f64 {
            let mut processor = Processor { now_ns: 7_000, readings: 0, aside };
            let length = CountLength::measured(|| Look {
                before_ns: processor.read_ns(),
                count: processor.read_ns() * 5 / 2,
                after_ns: processor.read_ns(),
            });
            length.times_ns(2_500_000_000_000) as f64 / 1e12
        }
    }

    #[test]
    fn being_put_aside_does_not_change_how_long_a_count_is() {
        const PAUSE_NS: u64 = 4_000_000;
        let cases: [(&str, &dyn Fn(usize) -> u64); 5] = [
            ("never", &|_| 0),
            ("before the first count", &|reading| if reading == 1 { PAUSE_NS } else { 0 }),
            ("after the first count", &|reading| if reading == 2 { PAUSE_NS } else { 0 }),
            ("before every hundredth reading, each in its turn", &|reading| {
                if reading % 100 == 1 { PAUSE_NS } else { 0 }
            }),
            ("before all readings but a few", &|reading| if reading % 1000 < 990 { 5_000 } else { 0 }),
        ];
        for (when, aside) in cases {
            let found = Processor::measured(aside);
            assert!((found - 1.0).abs() <= CountLength::ENOUGH, "put aside {when}: {found}");
        }
    }

    #[test]
    fn where_no_look_is_worth_much_the_measurement_ends_with_the_best() {
        let found = Processor::measured(&|reading| if reading % 3 == 1 { 100_000 } else { 0 });
        // The best is the longest: 50 us of doubt at either end of 200 ms.
        assert!((found - 1.0).abs() <= 100e-6 / 0.2, "{found}");
    }

    /// Between two looks at the system's clock there is no more time than these say.
    #[test]
    fn the_counter_and_the_clock_agree() {
        let stopwatch = Stopwatch::new();
        let least_error = (0..100).map(|_| {
            let (outer, from) = (monotonic_ns(), stopwatch.now());
            let inner = monotonic_ns();
            while monotonic_ns() < inner + 1_000_000 {
                std::hint::spin_loop();
            }
            let inner_ns = monotonic_ns() - inner;
            let (to, outer_ns) = (stopwatch.now(), monotonic_ns() - outer);
            let took_ns = stopwatch.between_ns(from, to);
            took_ns.saturating_sub(outer_ns).max(inner_ns.saturating_sub(took_ns))
        });
        // Of a millisecond in the best of a hundred tries a thousandth: a time service may make the clock itself faster or
        // slower by half of that at any moment, from either side to the other (adjtimex(2)).
        assert!(least_error.min() <= Some(1_000));
    }

    #[test]
    fn a_moment_before_is_no_time_ago() {
        let stopwatch = Stopwatch::new();
        let (before, after) = (stopwatch.now(), stopwatch.now());
        assert_eq!(stopwatch.between_ns(after, Moment(before.0 - 1)), 0);
    }
}
