//! How well this machine lets the servo keep time, next to the best a bare loop can do.
//!
//! Lateness on a shared machine is mostly the machine's. So the servo is compared with a loop that only sleeps
//! and spins: same spin window, same priority, same core, in alternating slices of a second, so that both meet
//! the same neighbours. What the servo adds is the difference.

use crate::servo::{
    Durations, Percentiles, RealTimeReport, Schedule, SpinWindow, StopSwitch, enter_real_time, monotonic_ns,
    sleep_until,
};
use crate::session::{RunError, Session};
use flotor_hal::SampleWait;
use flotor_hal::abi::loader::Stopper;
use serde::Serialize;

/// Length of one slice, ns.
const SLICE_NS: u64 = 1_000_000_000;

/// How one of the two loops kept time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LoopTiming {
    /// Start of a tick after its deadline.
    pub lateness_ns: Percentiles,
    /// Ticks run.
    pub ticks: u64,
    /// Ticks that started later than a tenth of the period.
    pub late_ticks: u64,
    /// Ticks skipped because their whole period had passed.
    pub missed_ticks: u64,
}

/// Servo and bare loop side by side.
#[derive(Clone, Debug, Serialize)]
pub struct JitterReport {
    /// Rate of both, Hz.
    pub rate_hz: f64,
    /// The final stretch before a deadline that both spin, ns.
    pub spin_window_ns: u64,
    /// Slices of each.
    pub slices: u64,
    /// The servo with its device, models and envelope.
    pub servo: LoopTiming,
    /// Sleep, spin, look at the clock.
    pub bare: LoopTiming,
    /// What the system granted to both.
    #[serde(skip)]
    pub real_time: RealTimeReport,
    /// Histograms of both, for a picture: lateness and how many ticks had it.
    #[serde(skip)]
    pub bins: [Vec<(u64, u64)>; 2],
}

/// Runs servo and bare loop in turns for `slices` seconds each. `progress` is called after each pair.
///
/// # Errors
/// [`RunError::Thread`] if the loop's thread cannot be had.
pub fn measure(
    session: Session,
    slices: u64,
    stop: &StopSwitch,
    progress: impl Fn(u64) + Send,
) -> Result<JitterReport, RunError> {
    let (mut servo, stoppers, period_ns) = session.into_loop();
    let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
    let report = std::thread::scope(|scope| {
        let measured = thread.spawn_scoped(scope, move || {
            let real_time = enter_real_time();
            let window = SpinWindow::measure(period_ns);
            let (mut with_servo, mut bare) = (Tally::default(), Tally::default());
            let mut done = 0;
            while done < slices && !stop.is_stop_asked() && stop.emergency().is_none() {
                let mut schedule = Schedule::start_real(period_ns, window);
                while schedule.next_time_ns() < SLICE_NS {
                    let Some(due) = schedule.wait(|_| SampleWait::NotPaced) else { break };
                    servo.tick(&due, stop, |_| ());
                    with_servo.count(due.lateness_ns.unwrap_or_default(), due.missed, period_ns);
                }
                bare_slice(&mut bare, period_ns, window);
                done += 1;
                progress(done);
            }
            #[allow(clippy::cast_precision_loss)] // a period is far below 2^53 ns
            let rate_hz = 1.0e9 / period_ns as f64;
            JitterReport {
                rate_hz,
                spin_window_ns: window.spin_ns,
                slices: done,
                servo: with_servo.timing(),
                bare: bare.timing(),
                real_time,
                bins: [with_servo.lateness.bins(), bare.lateness.bins()],
            }
        });
        let measured = measured.map_err(|_| RunError::Thread("could not be started"))?;
        measured.join().map_err(|_| RunError::Thread("panicked"))
    });
    stoppers.iter().for_each(Stopper::safe_stop);
    report
}

/// The yardstick, written out on its own: it shares no line with the servo's schedule but the system call.
fn bare_slice(tally: &mut Tally, period_ns: u64, window: SpinWindow) {
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
        tally.count((now_ns - deadline_ns) % period_ns, missed, period_ns);
        slot += 1 + missed;
    }
}

#[derive(Default)]
struct Tally {
    lateness: Durations,
    ticks: u64,
    late: u64,
    missed: u64,
}

impl Tally {
    fn count(&mut self, lateness_ns: u64, missed: u64, period_ns: u64) {
        self.lateness.record(lateness_ns);
        self.ticks += 1;
        self.missed += missed;
        if lateness_ns > period_ns / 10 {
            self.late += 1;
        }
    }

    fn timing(&self) -> LoopTiming {
        LoopTiming {
            lateness_ns: self.lateness.percentiles(),
            ticks: self.ticks,
            late_ticks: self.late,
            missed_ticks: self.missed,
        }
    }
}
