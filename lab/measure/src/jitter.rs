//! Timing of the servo on this machine, compared with that of a bare loop.
//!
//! Lateness on a shared machine is mostly caused by the machine. So the servo is compared with a loop that only sleeps
//! and spins: with equal spin window, priority and core, in alternating slices of a second, so that both have the same
//! neighbours. The difference is caused by the servo.

use flotor_hal::SampleWait;
use flotor_loader::Stopper;
use flotor_servo::{
    Percentiles, RealTimeReport, RunState, Schedule, SpinWindow, StopSwitch, Timing, enter_real_time,
    monotonic_ns, sleep_until,
};
use flotor_session::{RunError, Session};
use serde::Serialize;

/// Length of one slice, ns.
const SLICE_NS: u64 = 1_000_000_000;

/// Timing of one of the two loops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LoopTiming {
    /// Delay of a tick's start after its deadline, ns.
    pub lateness_ns: Percentiles,
    /// Number of ticks run.
    pub ticks: u64,
    /// Number of ticks that started late by more than a tenth of the period.
    pub late_ticks: u64,
    /// Number of ticks skipped because their whole period had passed.
    pub missed_ticks: u64,
}

/// Timing of servo and bare loop.
#[derive(Clone, Debug, Serialize)]
pub struct JitterReport {
    /// Rate of both loops, Hz.
    pub rate_hz: f64,
    /// Time before a deadline that both loops spin, ns.
    pub spin_window_ns: u64,
    /// Number of slices of each loop.
    pub slices: u64,
    /// Timing of the servo with its device, models and envelope.
    pub servo: LoopTiming,
    /// Timing of the bare loop: sleep, spin, read the clock.
    pub bare: LoopTiming,
    /// Difference of the missed ticks, with its standard error.
    pub missed_more: MissedMore,
    /// Real-time configuration of both loops.
    #[serde(skip)]
    pub real_time: RealTimeReport,
    /// Histograms of both loops, for a picture: lateness, ns, and number of ticks.
    #[serde(skip)]
    pub bins: [Vec<(u64, u64)>; 2],
}

/// Difference of the missed ticks between servo and bare loop.
///
/// On a shared machine a second without disturbance is followed by a second with twenty missed ticks, in either loop. The scatter
/// of the pairs of slices estimates the part of the difference due to such disturbances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MissedMore {
    /// Missed ticks of the servo less those of the bare loop.
    pub ticks: f64,
    /// Standard error of `ticks`; grows with the square root of the time. `None` for a single pair.
    pub standard_error: Option<f64>,
}

/// Runs servo and bare loop alternately for `slices` seconds each, or until a stop request, then stops the devices. `progress`
/// is called after each pair with the number of pairs so far.
///
/// # Errors
/// [`RunError::NoThread`] if a thread cannot be started, [`RunError::Latched`] if the emergency-stop latch is pressed,
/// [`RunError::Plugin`] if a device rejects activation, [`RunError::Thread`] if the loop panicked.
pub fn measure(
    session: Session,
    slices: u64,
    stop: &StopSwitch,
    progress: impl Fn(u64) + Send,
) -> Result<JitterReport, RunError> {
    let period_ns = session.period_ns();
    let _watch = session.latch().map(|latch| latch.check_and_watch(stop)).transpose()?;
    let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
    std::thread::scope(|scope| {
        let measured = thread.spawn_scoped(scope, move || {
            let real_time = enter_real_time(session.core());
            let window = SpinWindow::measure(period_ns);
            let (mut servo, stoppers) = session.into_loop()?;
            let (mut with_servo, mut bare) = (Timing::default(), Timing::default());
            let mut pairs = Pairs::default();
            let mut done = 0;
            while done < slices && !stop.is_stop_requested() && stop.emergency().is_none() {
                let missed_before = [with_servo.missed, bare.missed];
                let mut schedule = Schedule::start_real(period_ns, window);
                while schedule.next_time_ns() < SLICE_NS {
                    let Ok(due) = schedule.wait(|_| SampleWait::NotPaced) else { break };
                    servo.tick(&due, stop, |_| ());
                    count(&mut with_servo, due.lateness_ns.unwrap_or_default(), due.missed, period_ns);
                }
                bare_slice(&mut bare, period_ns, window);
                let [servo_before, bare_before] = missed_before;
                pairs.add(with_servo.missed - servo_before, bare.missed - bare_before);
                done += 1;
                progress(done);
            }
            // Stopped by a button, or by the device itself.
            if let RunState::EmergencyStopped(source) = servo.run() {
                stop.press(source);
            }
            stoppers.iter().for_each(Stopper::safe_stop);
            let rate_hz = 1.0e9 / period_ns as f64;
            Ok(JitterReport {
                rate_hz,
                spin_window_ns: window.spin_ns,
                slices: done,
                servo: (&with_servo).into(),
                bare: (&bare).into(),
                missed_more: pairs.missed_more(),
                real_time,
                bins: [with_servo.lateness.bins(), bare.lateness.bins()],
            })
        });
        let measured = measured.map_err(|_| RunError::NoThread("the loop"))?;
        measured.join().map_err(|_| RunError::Thread("panicked"))?
    })
}

/// Runs the bare loop, written separately: it shares only the system call with the servo's schedule.
fn bare_slice(timing: &mut Timing, period_ns: u64, window: SpinWindow) {
    let start_ns = monotonic_ns() + period_ns;
    let mut slot = 0;
    while slot * period_ns < SLICE_NS {
        let deadline_ns = start_ns + slot * period_ns;
        if monotonic_ns() + window.spin_ns < deadline_ns {
            sleep_until(deadline_ns - window.spin_ns);
        }
        let mut now_ns = monotonic_ns();
        while now_ns < deadline_ns {
            std::hint::spin_loop();
            now_ns = monotonic_ns();
        }
        let missed = (now_ns - deadline_ns) / period_ns;
        count(timing, (now_ns - deadline_ns) % period_ns, missed, period_ns);
        slot += 1 + missed;
    }
}

/// Differences between the slices of a pair, over all pairs.
#[derive(Default)]
struct Pairs {
    count: f64,
    sum: f64,
    sum_of_squares: f64,
}

impl Pairs {
    fn add(&mut self, servo: u64, bare: u64) {
        let difference = servo as f64 - bare as f64;
        self.count += 1.0;
        self.sum += difference;
        self.sum_of_squares += difference * difference;
    }

    /// Returns the sum over the pairs with its standard error: √n times that of one pair, as the n pairs count as
    /// independent.
    fn missed_more(&self) -> MissedMore {
        let variance = (self.sum_of_squares - self.sum * self.sum / self.count) / (self.count - 1.0);
        let standard_error = (self.count > 1.0).then(|| (self.count * variance.max(0.0)).sqrt());
        MissedMore { ticks: self.sum, standard_error }
    }
}

/// Counts a tick.
fn count(timing: &mut Timing, lateness_ns: u64, missed: u64, period_ns: u64) {
    timing.lateness.record(lateness_ns);
    timing.ticks += 1;
    timing.missed += missed;
    timing.late += u64::from(lateness_ns > period_ns / 10);
}

impl From<&Timing> for LoopTiming {
    fn from(timing: &Timing) -> Self {
        let Timing { lateness, ticks, late, missed, .. } = timing;
        let lateness_ns = lateness.percentiles();
        Self { lateness_ns, ticks: *ticks, late_ticks: *late, missed_ticks: *missed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_pairs(pairs: &[(u64, u64)]) -> MissedMore {
        let mut all = Pairs::default();
        pairs.iter().for_each(|(servo, bare)| all.add(*servo, *bare));
        all.missed_more()
    }

    #[test]
    fn a_difference_is_worth_as_much_as_the_pairs_agree() {
        assert_eq!(of_pairs(&[]), MissedMore { ticks: 0.0, standard_error: None });
        assert_eq!(of_pairs(&[(5, 2)]), MissedMore { ticks: 3.0, standard_error: None });
        // Always one more: no uncertainty, whatever both have in common.
        let steady = of_pairs(&[(1, 0), (21, 20), (8, 7), (4, 3)]);
        assert_eq!(steady, MissedMore { ticks: 4.0, standard_error: Some(0.0) });
        // Differences 3, -1, -1, 3: a mean of 1, a variance of 16/3 each.
        let wild = of_pairs(&[(3, 0), (0, 1), (6, 7), (5, 2)]);
        assert_eq!(wild.ticks, 4.0);
        assert!(
            wild.standard_error.is_some_and(|error| (error - (4.0_f64 * 16.0 / 3.0).sqrt()).abs() < 1e-12)
        );
    }
}
