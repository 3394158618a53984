//! Timer for the stages of a tick, which reads the processor's time-stamp counter.
//!
//! Reading the system's clock waits for all earlier instructions and delays all later ones, which costs a tick twice the time of
//! the reading. Reading the counter does not. Its rate is measured once against the system's clock; a processor without a steady
//! counter uses the system's clock.
//!
//! `quanta` measures the rate, too, but trusts its first pair of readings: in a process suspended for 4 ms between these readings,
//! all times are wrong by 2 %. Here each reading of the counter lies between two of the clock, which bound its error, and the
//! measurement continues until the bound is small enough.
//!
//! Deadlines and lateness use the system's clock alone (`clock.rs`).

use std::sync::OnceLock;

use quanta::Clock;

use super::clock::monotonic_ns;

/// Reading of the counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moment(u64);

/// Time-stamp counter with the length of a count.
pub(super) struct StageTimer {
    counter: Clock,
    count: CountLength,
}

impl StageTimer {
    /// Creates a timer. Not real-time: the first timer of a process measures the rate of the counter, in two or three milliseconds
    /// on an idle machine, and in 0.4 s at most, plus interruptions, on a busy machine.
    pub(super) fn new() -> Self {
        static COUNT: OnceLock<CountLength> = OnceLock::new();
        let counter = Clock::new();
        let count = *COUNT.get_or_init(|| CountLength::measured(|| ClockReading::at(&counter)));
        Self { counter, count }
    }

    /// Reads the counter. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn now(&self) -> Moment {
        Moment(self.counter.raw())
    }

    /// Returns the time between two moments, ns; 0 if `to` is before `from`. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn between_ns(&self, from: Moment, to: Moment) -> u64 {
        self.count.times_ns(to.0.saturating_sub(from.0))
    }
}

/// Reading of the counter between two readings of the clock.
#[derive(Clone, Copy)]
struct ClockReading {
    before_ns: u64,
    count: u64,
    after_ns: u64,
}

impl ClockReading {
    /// Coarsest resolution of a clock or a counter, ns: the time read may be older by this step. Hyper-V's clock has 100 ns, a
    /// counter of 24 MHz 42 ns.
    const STEP_NS: u64 = 100;

    fn at(counter: &Clock) -> Self {
        Self { before_ns: monotonic_ns(), count: counter.raw(), after_ns: monotonic_ns() }
    }

    /// Returns the uncertainty of the clock's time at the count, ns.
    fn uncertainty_ns(self) -> u64 {
        self.after_ns - self.before_ns + Self::STEP_NS
    }
}

/// Length of one count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountLength {
    /// Length in 2⁻³² ns: finer than the measurement even for a counter of 10 GHz.
    parts: u64,
}

impl CountLength {
    const PARTS_PER_NS_LOG2: u32 = 32;
    /// Relative error at which the measurement ends, against the clock as it runs meanwhile: a hundredth of the histograms'
    /// resolution (two digits, `timing.rs`). An idle machine gets there in two milliseconds.
    const ENOUGH: f64 = 100e-6;
    /// Time after which the measurement ends in any case, with its best result, ns: the longest that `quanta` takes.
    const LONGEST_NS: u64 = 200_000_000;
    /// Number of initial readings, of which the reading with the least uncertainty is used.
    const FIRST_LOOKS: usize = 32;

    /// Measures the length of a count. Not real-time.
    fn measured(mut poll: impl FnMut() -> ClockReading) -> Self {
        let mut first = poll();
        for _ in 1..Self::FIRST_LOOKS {
            let next = poll();
            first = if next.uncertainty_ns() < first.uncertainty_ns() { next } else { first };
        }
        // Zero length if the counter never advances.
        let (mut least_uncertainty, mut best) = (f64::INFINITY, Self { parts: 0 });
        loop {
            let last = poll();
            // Twice the time from the middle of the first reading to the middle of the last.
            let twice_ns = (last.before_ns - first.before_ns) + (last.after_ns - first.after_ns);
            let uncertainty = (first.uncertainty_ns() + last.uncertainty_ns()) as f64 / twice_ns as f64;
            // The counters of two cores may differ, and the process may have moved to another core. Only a difference larger than
            // the elapsed time can be detected.
            if uncertainty < least_uncertainty && last.count > first.count {
                (least_uncertainty, best) = (uncertainty, Self::of(twice_ns, 2 * (last.count - first.count)));
            }
            if least_uncertainty <= Self::ENOUGH || twice_ns / 2 >= Self::LONGEST_NS {
                return best;
            }
        }
    }

    /// Returns the length of a count from the number of counts in `ns`.
    #[allow(clippy::cast_possible_truncation)] // some 2³², or the counter is slower than a wall clock
    fn of(ns: u64, counts: u64) -> Self {
        Self { parts: ((u128::from(ns) << Self::PARTS_PER_NS_LOG2) / u128::from(counts)) as u64 }
    }

    /// Converts counts to ns. Real-time: bounded, no allocation.
    #[inline]
    #[allow(clippy::cast_possible_truncation)] // 2⁶⁴ ns are 584 years
    fn times_ns(self, counts: u64) -> u64 {
        ((u128::from(counts) * u128::from(self.parts)) >> Self::PARTS_PER_NS_LOG2) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor that takes 27 ns for every reading, counts at 2.5 GHz and is put aside for a while before those readings. Its
    /// clock moves in steps.
    struct Processor<'a> {
        now_ns: u64,
        readings: usize,
        clock_step_ns: u64,
        aside_ns: &'a dyn Fn(usize) -> u64,
    }

    impl<'a> Processor<'a> {
        fn new(aside_ns: &'a dyn Fn(usize) -> u64) -> Self {
            Self { now_ns: 7_000, readings: 0, clock_step_ns: 1, aside_ns }
        }

        fn pass(&mut self) -> u64 {
            self.now_ns += 27 + (self.aside_ns)(self.readings);
            self.readings += 1;
            self.now_ns
        }

        fn clock_ns(&mut self) -> u64 {
            self.pass() / self.clock_step_ns * self.clock_step_ns
        }

        fn poll(&mut self) -> ClockReading {
            ClockReading { before_ns: self.clock_ns(), count: self.pass() * 5 / 2, after_ns: self.clock_ns() }
        }

        /// How wrong the measurement is, relative.
        fn error(mut self) -> f64 {
            let length = CountLength::measured(|| self.poll());
            (length.times_ns(2_500_000_000_000) as f64 / 1e12 - 1.0).abs()
        }
    }

    #[test]
    fn being_put_aside_does_not_change_how_long_a_count_is() {
        const LONG_NS: u64 = 4_000_000;
        let cases: [(&str, &dyn Fn(usize) -> u64); 5] = [
            ("never", &|_| 0),
            ("before the first count", &|reading| if reading == 1 { LONG_NS } else { 0 }),
            ("after the first count", &|reading| if reading == 2 { LONG_NS } else { 0 }),
            ("within the first look after the first looks", &|reading| {
                if reading == 97 { LONG_NS } else { 0 }
            }),
            ("often, anywhere in a look", &|reading| if reading % 40 == 1 { 40_000 } else { 0 }),
        ];
        for (when, aside_ns) in cases {
            let error = Processor::new(aside_ns).error();
            assert!(error <= CountLength::ENOUGH, "put aside {when}: {error}");
        }
    }

    #[test]
    fn being_put_aside_at_random_does_not_either() {
        for (seed, most_ns) in (0..40).zip([1_000, 30_000, 1_000_000_u64].into_iter().cycle()) {
            let aside_ns = |reading: usize| {
                // A hash (splitmix64's finisher, Steele et al. 2014): the same for the same reading.
                let mut random = (reading as u64 + seed * 1_000_003).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                random = (random ^ (random >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                random ^= random >> 27;
                if random.is_multiple_of(6) { (random >> 32) % most_ns } else { 0 }
            };
            let error = Processor::new(&aside_ns).error();
            assert!(error <= CountLength::ENOUGH, "seed {seed}: {error}");
        }
    }

    #[test]
    fn a_clock_that_moves_in_steps_is_no_better_than_its_steps() {
        for start_ns in 7_000..7_100 {
            let processor = Processor {
                clock_step_ns: ClockReading::STEP_NS,
                now_ns: start_ns,
                ..Processor::new(&|_| 0)
            };
            let error = processor.error();
            assert!(error <= CountLength::ENOUGH, "from {start_ns}: {error}");
        }
    }

    /// 100 us before the count in the first looks and after it in the others: the middle of each is 50 us off, to either side.
    #[test]
    fn where_no_look_is_worth_much_the_measurement_ends_with_the_best() {
        let first = 3 * CountLength::FIRST_LOOKS;
        let aside_ns = |reading| if reading % 3 == if reading < first { 1 } else { 2 } { 100_000 } else { 0 };
        let uncertainty_ns = Processor::new(&aside_ns).poll().uncertainty_ns();
        let error = Processor::new(&aside_ns).error();
        assert!(error <= uncertainty_ns as f64 / CountLength::LONGEST_NS as f64, "{error}");
    }

    #[test]
    fn a_counter_that_is_behind_its_beginning_is_not_believed() {
        let mut processor = Processor::new(&|_| 0);
        let mut looks = 0;
        let length = CountLength::measured(|| {
            looks += 1;
            let reading = processor.poll();
            // On the other core for a while after the first looks.
            let is_behind = (CountLength::FIRST_LOOKS..200).contains(&looks);
            ClockReading { count: if is_behind { reading.count - 12_000 } else { reading.count }, ..reading }
        });
        let error = (length.times_ns(2_500_000) as f64 / 1e6 - 1.0).abs();
        assert!(error <= CountLength::ENOUGH, "{error}");
    }

    /// Between two looks at the system's clock there is no more time than these say.
    #[test]
    fn the_counter_and_the_clock_agree() {
        let stage_timer = StageTimer::new();
        let least_error = (0..100).map(|_| {
            let (outer, from) = (monotonic_ns(), stage_timer.now());
            let inner = monotonic_ns();
            while monotonic_ns() < inner + 1_000_000 {
                std::hint::spin_loop();
            }
            let inner_ns = monotonic_ns() - inner;
            let (to, outer_ns) = (stage_timer.now(), monotonic_ns() - outer);
            let took_ns = stage_timer.between_ns(from, to);
            took_ns.saturating_sub(outer_ns).max(inner_ns.saturating_sub(took_ns))
        });
        // Of a millisecond, in the best of a hundred tries: what the measurement may be wrong by, and the frequency of the clock,
        // which a time service may move from one end of its range, +-500 ppm (adjtimex(2)), to the other.
        assert!(least_error.min() <= Some(1_100));
    }

    #[test]
    fn a_moment_before_is_no_time_ago() {
        let stage_timer = StageTimer::new();
        let (before, after) = (stage_timer.now(), stage_timer.now());
        assert_eq!(stage_timer.between_ns(after, Moment(before.0 - 1)), 0);
    }
}
