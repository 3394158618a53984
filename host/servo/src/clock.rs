//! Schedule of the ticks: absolute deadlines on the monotonic clock, the samples of a device, or a virtual clock without waiting.
//!
//! The time of a tick is a multiple of the period. A tick whose whole period has passed is counted as missed and skipped, never
//! caught up in a burst.

pub use crate::platform::clock::{monotonic_ns, sleep_until};
pub use flotor_core::Clock;
use flotor_hal::{SampleWait, Tick};

/// Time before a deadline in which the loop spins instead of sleeping: a sleeping thread wakes late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpinWindow {
    /// Length of the window, ns.
    pub spin_ns: u64,
}

impl SpinWindow {
    /// Number of measured sleeps.
    const SAMPLES: usize = 64;
    /// Length of a measured sleep, ns: long enough for the core to go idle, as between ticks.
    const SAMPLE_SLEEP_NS: u64 = 400_000;
    /// Narrowest and widest window, ns: a narrower one absorbs no lateness, a wider one occupies the core.
    const BOUNDS_NS: [u64; 2] = [20_000, 250_000];

    /// Measures the wake-up latency of the calling thread, and returns a spin window of 1.25 times the 95th percentile, clamped to
    /// 20 to 250 µs and to at most half the period. Not real-time: takes about 30 ms. Call this function on the loop thread, at the
    /// priority of the loop.
    #[must_use]
    pub fn measure(period_ns: u64) -> Self {
        let mut lateness_ns = [0; Self::SAMPLES];
        for sample in &mut lateness_ns {
            let deadline = monotonic_ns() + Self::SAMPLE_SLEEP_NS;
            sleep_until(deadline);
            *sample = monotonic_ns().saturating_sub(deadline);
        }
        lateness_ns.sort_unstable();
        let usual_ns = lateness_ns.get(Self::SAMPLES * 19 / 20).copied().unwrap_or_default();
        let [narrowest, widest] = Self::BOUNDS_NS;
        let spin_ns = (usual_ns + usual_ns / 4).clamp(narrowest, widest).min(period_ns / 2);
        Self { spin_ns }
    }
}

/// Schedule of the ticks of a loop, on one of three time bases.
#[derive(Clone, Copy)]
pub struct Schedule {
    pace: Pace,
    period_ns: u64,
    start_ns: u64,
    /// Number of periods from the start to the next tick.
    slot: u64,
    next_index: u64,
    last_slot: u64,
}

/// Time base of the ticks.
#[derive(Clone, Copy)]
enum Pace {
    /// Virtual clock, without waiting.
    Virtual,
    /// Deadlines on the machine's clock.
    Clock(SpinWindow),
    /// Samples of the device, with the time of the last one.
    Device { last_ns: u64 },
}

/// Tick to run now, with its lateness and the number of ticks missed before.
#[derive(Debug)]
pub struct Due {
    /// Index, time and time step of the tick.
    pub tick: Tick,
    /// Delay after the deadline, or after the expected arrival of the sample, without missed periods, ns; `None` on the virtual clock.
    pub lateness_ns: Option<u64>,
    /// Number of ticks skipped just before the tick.
    pub missed: u64,
}

/// Error of a device that sets the pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaceLost {
    /// The device has reported that it does not set the pace.
    NotPaced,
    /// Samples arrive faster than the period that the loop counts for each: in real time, velocities and slew rates would exceed
    /// their limits.
    TooFast {
        /// Number of sample periods counted so far.
        samples: u64,
        /// Time since the start, ns.
        elapsed_ns: u64,
    },
}

/// Allowed lead of a device that sets the pace over the machine's clock, ns: samples that the device buffered before the start, or
/// while the loop was delayed.
const AHEAD_NS: u64 = 250_000_000;
/// Divisor of the time since the start that gives the allowed further lead: 2 %. Two oscillators differ by far less.
const AHEAD_SHARE: u64 = 50;

/// Result of a wait on the machine's clock.
#[derive(Clone, Copy)]
struct Woken {
    /// Delay of the wake-up after the deadline of the tick to run, or after the expected arrival of the sample, ns; missed ticks do
    /// not count.
    late_ns: u64,
    /// Number of missed ticks: whole periods passed since the deadline, or samples not read before the newest sample.
    missed: u64,
}

impl Schedule {
    /// Creates a schedule on the monotonic clock; the first tick is due one period from now.
    pub fn start_real(period_ns: u64, window: SpinWindow) -> Self {
        Self::start(Pace::Clock(window), period_ns, monotonic_ns() + period_ns)
    }

    /// Creates a schedule on the virtual clock, without waiting.
    pub fn start_virtual(period_ns: u64) -> Self {
        Self::start(Pace::Virtual, period_ns, 0)
    }

    /// Creates a schedule paced by a device's samples; the first is expected one period from now.
    pub fn start_paced(period_ns: u64) -> Self {
        let now_ns = monotonic_ns();
        Self::start(Pace::Device { last_ns: now_ns }, period_ns, now_ns)
    }

    fn start(pace: Pace, period_ns: u64, start_ns: u64) -> Self {
        Self { pace, period_ns, start_ns, slot: 0, next_index: 0, last_slot: 0 }
    }

    /// Waits for the next tick. If a device sets the pace, `wait_for_sample` waits for its next sample with a timeout, ns.
    /// Real-time: sleeps, then spins; no allocation.
    ///
    /// # Errors
    /// [`PaceLost`] if the device does not set the pace, or sends samples too fast.
    pub fn wait(&mut self, wait_for_sample: impl FnOnce(u64) -> SampleWait) -> Result<Due, PaceLost> {
        let woken = match self.pace {
            Pace::Virtual => None,
            Pace::Clock(window) => Some(self.wait_for_deadline(window)),
            Pace::Device { last_ns } => {
                let waited = wait_for_sample(Self::PATIENCE_PERIODS * self.period_ns);
                Some(self.follow(last_ns, waited)?)
            }
        };
        let missed = woken.map_or(0, |woken| woken.missed);
        self.slot += missed;
        let tick = Tick {
            index: self.next_index,
            time_ns: self.slot * self.period_ns,
            dt_ns: (self.slot - self.last_slot) * self.period_ns,
        };
        self.last_slot = self.slot;
        self.slot += 1;
        self.next_index += 1;
        Ok(Due { tick, lateness_ns: woken.map(|woken| woken.late_ns), missed })
    }

    /// Timeout of a sample, in periods. The tick then runs without a sample: the force has to fade out even if the device is silent.
    const PATIENCE_PERIODS: u64 = 2;

    /// Waits for the deadline of a tick on the machine's clock.
    fn wait_for_deadline(&mut self, window: SpinWindow) -> Woken {
        let deadline = self.start_ns + self.slot * self.period_ns;
        let mut now = monotonic_ns();
        if now + window.spin_ns < deadline {
            sleep_until(deadline - window.spin_ns);
            now = monotonic_ns();
        }
        while now < deadline {
            std::hint::spin_loop();
            now = monotonic_ns();
        }
        let late = now - deadline;
        // Ticks whose whole period has passed are missed.
        let missed = late / self.period_ns;
        Woken { late_ns: late - missed * self.period_ns, missed }
    }

    /// Converts the result of a wait for a sample to a tick.
    fn follow(&mut self, last_ns: u64, waited: SampleWait) -> Result<Woken, PaceLost> {
        let periods = match waited {
            SampleWait::NotPaced => return Err(PaceLost::NotPaced),
            SampleWait::Arrived { samples } => samples.max(1),
            SampleWait::TimedOut => {
                // A wait that returns at once must not make the loop spin.
                sleep_until(last_ns + self.period_ns);
                ((monotonic_ns() - last_ns) / self.period_ns).max(1)
            }
        };
        let now_ns = monotonic_ns();
        self.pace = Pace::Device { last_ns: now_ns };
        let elapsed_ns = now_ns.saturating_sub(self.start_ns);
        if self.next_time_ns() > elapsed_ns + elapsed_ns / AHEAD_SHARE + AHEAD_NS {
            return Err(PaceLost::TooFast { samples: self.slot, elapsed_ns });
        }
        let late_ns = now_ns.saturating_sub(last_ns + periods * self.period_ns);
        Ok(Woken { late_ns, missed: periods - 1 })
    }

    /// Returns the duration of the run, ns. On the monotonic clock first waits for the end of the last tick's period; whole periods
    /// of delay after that end do not count.
    pub fn finish(mut self) -> u64 {
        match self.pace {
            Pace::Virtual => self.next_time_ns(),
            Pace::Clock(window) => self.next_time_ns() + self.wait_for_deadline(window).late_ns,
            Pace::Device { .. } => monotonic_ns() - self.start_ns,
        }
    }

    /// Returns true on the virtual clock.
    pub(crate) fn is_virtual(&self) -> bool {
        matches!(self.pace, Pace::Virtual)
    }

    /// Returns the index of the next tick; indices count from 0, without gaps for missed ticks.
    pub fn next_index(&self) -> u64 {
        self.next_index
    }

    /// Returns the scheduled time of the next tick, ns after the start of the run.
    pub fn next_time_ns(&self) -> u64 {
        self.slot * self.period_ns
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // a test may sleep and look at another clock
    use super::*;

    /// What a schedule does not ask for on a clock.
    fn no_device(_: u64) -> SampleWait {
        panic!("nobody is to be waited for")
    }

    fn wait(schedule: &mut Schedule) -> Due {
        schedule.wait(no_device).expect("a tick is due")
    }

    #[test]
    fn a_device_that_paces_gives_the_ticks_and_samples_nobody_read_are_missed() {
        let mut schedule = Schedule::start_paced(1_000_000);
        let mut next = |samples| schedule.wait(|_| SampleWait::Arrived { samples }).expect("a sample came");
        assert_eq!(next(1).tick, Tick { index: 0, time_ns: 0, dt_ns: 0 });
        assert_eq!(next(1).tick, Tick { index: 1, time_ns: 1_000_000, dt_ns: 1_000_000 });
        let due = next(3);
        assert_eq!((due.missed, due.tick), (2, Tick { index: 2, time_ns: 4_000_000, dt_ns: 3_000_000 }));
    }

    #[test]
    fn a_device_that_says_nothing_more_still_lets_the_loop_run_at_its_rate() {
        let started = std::time::Instant::now();
        let mut schedule = Schedule::start_paced(1_000_000);
        for _ in 0..20 {
            assert!(schedule.wait(|_| SampleWait::TimedOut).is_ok(), "it gives up at once");
        }
        assert!(started.elapsed() >= std::time::Duration::from_millis(20), "twenty periods have passed");
    }

    #[test]
    fn a_device_that_does_not_pace_after_all_ends_the_loop() {
        let waited = Schedule::start_paced(1_000_000).wait(|_| SampleWait::NotPaced);
        assert_eq!(waited.err(), Some(PaceLost::NotPaced));
    }

    #[test]
    fn a_device_whose_samples_come_faster_than_time_is_counted_ends_the_loop() {
        let mut schedule = Schedule::start_paced(1_000_000);
        let ahead = (0..10_000).find_map(|_| schedule.wait(|_| SampleWait::Arrived { samples: 1 }).err());
        // None of them waits: 250 ms and what the test takes are too far ahead.
        let Some(PaceLost::TooFast { samples, elapsed_ns }) = ahead else { panic!("{ahead:?}") };
        assert!(
            samples * 1_000_000 > elapsed_ns + AHEAD_NS && samples >= 250,
            "{samples} in {elapsed_ns} ns"
        );
    }

    #[test]
    fn virtual_ticks_are_evenly_spaced_from_zero() {
        let mut schedule = Schedule::start_virtual(250_000);
        let ticks: Vec<Tick> = (0..3).map(|_| wait(&mut schedule).tick).collect();
        assert_eq!(ticks[0], Tick { index: 0, time_ns: 0, dt_ns: 0 });
        assert_eq!(ticks[2], Tick { index: 2, time_ns: 500_000, dt_ns: 250_000 });
    }

    #[test]
    fn a_delayed_loop_skips_what_is_past_and_counts_it() {
        let period_ns = 1_000_000;
        let mut schedule = Schedule::start_real(period_ns, SpinWindow { spin_ns: 50_000 });
        let first = wait(&mut schedule);
        std::thread::sleep(std::time::Duration::from_millis(20));
        let due = wait(&mut schedule);
        assert!(due.missed >= 15, "{}", due.missed); // 20 periods passed; a loaded machine only adds to them
        assert!(due.lateness_ns.is_some_and(|late_ns| late_ns < period_ns));
        assert_eq!(due.tick.index, 1);
        assert_eq!(due.tick.dt_ns, (due.missed + 1) * period_ns);
        assert_eq!(due.tick.time_ns, first.tick.time_ns + due.tick.dt_ns);
    }

    #[test]
    fn a_loop_that_was_delayed_at_its_end_ran_no_longer_for_it() {
        let period_ns = 1_000_000;
        let started_ns = monotonic_ns() - 20 * period_ns;
        let mut schedule = Schedule::start(Pace::Clock(SpinWindow { spin_ns: 0 }), period_ns, started_ns);
        schedule.slot = 5; // five ticks ran, then nothing for a time
        let elapsed_ns = schedule.finish();
        assert!((5 * period_ns..6 * period_ns).contains(&elapsed_ns), "{elapsed_ns}");
    }
}
