//! Thread that holds a levitating handle in the rig: all axes but the vertical locked, a force along the vertical.
//!
//! The thread keeps sending commands while the procedure does other work, as a device without commands removes its
//! force. A tick neither allocates nor blocks. As in a run, all commands pass through the envelope, a watchdog stops a
//! device whose call does not return, and an emergency stop ends both thread and force.

use super::{AVERAGED_TICKS, Mean, PERIOD_NS, locked};
use crate::CalibrationError;
use flotor_core::plausibility::{PlausibilityCheck, Trust};
use flotor_core::trace::Events;
use flotor_hal::{Conditions, Cycle, DeviceState, Fault, Tick};
use flotor_loader::{ActiveDevice, OpenedDevice, Stopper};
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{
    EmergencySource, Envelope, Gate, Heartbeat, LastStop, Place, StopSwitch, enter_real_time, start_watchdog,
};
use flotor_sync::{Observer, Publisher, Words, latest};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Fastest change of the vertical force, N per tick: from 0 to 12 N in half a second.
const RAMP_STEP_N: f64 = 0.024;
/// Vertical speed above which the handle counts as having lost contact with the sensor, m/s.
const RUNAWAY_M_PER_S: f64 = 0.1;
/// Difference of two successive mean heights that counts as rest, m: the resolution of the device (5 to 10 µm;
/// Varadharajan 2007, section 2.2).
pub(super) const REST_M: f64 = 10.0e-6;
/// Difference of two successive mean delivered forces that counts as steady, N: the noise of the sensor. A single tick
/// without the force, as on a delayed host, changes a mean by five times that.
pub(super) const STEADY_N: f64 = 0.02;
/// Damping that brakes the handle, N·s/m (that of the locked axes).
const BRAKE_NS_PER_M: f64 = 15.0;
/// Number of ticks without a new sample after which the force is removed, as the position is unknown (10 ms, as in a run).
const STALE_TICKS_LIMIT: u32 = 10;
/// Watchdog timeout, ns. No hand is on the handle: longer than in a run, so that other load on the machine does not end
/// a calibration of an hour.
const WATCHDOG_NS: u64 = 500_000_000;
/// Poll interval for the end of the thread.
const LOOK_FOR_END: Duration = Duration::from_millis(1);

/// Command to the thread.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Command {
    /// Upward force, N.
    Push(f64),
    /// Removes the force and ends the thread.
    End,
}

const COMMAND_WORDS: usize = 2;

impl Words<COMMAND_WORDS> for Command {
    fn to_words(&self) -> [u64; COMMAND_WORDS] {
        match self {
            Self::Push(force_n) => [0, force_n.to_bits()],
            Self::End => [1, 0],
        }
    }

    fn from_words(&[kind, force_bits]: &[u64; COMMAND_WORDS]) -> Self {
        if kind == 0 { Self::Push(f64::from_bits(force_bits)) } else { Self::End }
    }
}

/// State of the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Report {
    pub(super) state: Holding,
    /// Last complete mean of the height, m; until two means are complete, the mean in progress (NaN without a sample).
    pub(super) height_m: f64,
    /// Absolute difference to the previous mean height, m; infinite until two means are complete.
    pub(super) moved_m: f64,
    /// Last complete mean of the delivered vertical force as reported by the device, N; 0 until two means are complete.
    pub(super) delivered_n: f64,
    /// Number of completed means so far.
    pub(super) means: u64,
    /// Number of means that differed from the previous one in height or force.
    pub(super) restless: u64,
    /// Number of ticks with saturation reported by the device, in the last two complete means.
    pub(super) saturated: u64,
}

const REPORT_WORDS: usize = 8;

impl Words<REPORT_WORDS> for Report {
    fn to_words(&self) -> [u64; REPORT_WORDS] {
        let (kind, detail) = match self.state {
            Holding::Changing => (0, 0),
            Holding::Steady(force_n) => (1, force_n.to_bits()),
            Holding::LostContact => (2, 0),
            Holding::Oscillated => (4, 0),
            Holding::Faulted(fault) => (3, u64::from(fault as u32)),
        };
        let [height, moved, delivered] = [self.height_m, self.moved_m, self.delivered_n].map(f64::to_bits);
        [kind, detail, height, moved, delivered, self.means, self.restless, self.saturated]
    }

    fn from_words(words: &[u64; REPORT_WORDS]) -> Self {
        let &[kind, detail, height, moved, delivered, means, restless, saturated] = words;
        let state = match kind {
            0 => Holding::Changing,
            1 => Holding::Steady(f64::from_bits(detail)),
            2 => Holding::LostContact,
            4 => Holding::Oscillated,
            _ => {
                let code = u32::try_from(detail).unwrap_or(u32::MAX);
                Holding::Faulted(Fault::from_code(code).unwrap_or(Fault::Broken))
            }
        };
        let [height_m, moved_m, delivered_n] = [height, moved, delivered].map(f64::from_bits);
        Self { state, height_m, moved_m, delivered_n, means, restless, saturated }
    }
}

/// State of the thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Holding {
    /// The force is ramping to its target, or two means at the target force are not complete yet.
    Changing,
    /// The force has had this value, N, for at least two complete means.
    Steady(f64),
    /// The handle lost contact and is braked, without vertical force.
    LostContact,
    /// The force of an axis alternated between its limits and was removed.
    Oscillated,
    /// The device faulted.
    Faulted(Fault),
}

/// Safety checks between the thread and the device, with the means to stop both.
pub(super) struct Guard {
    pub(super) envelope: Envelope,
    pub(super) plausibility: PlausibilityCheck,
    pub(super) stopper: Stopper,
    pub(super) stop: StopSwitch,
    pub(super) watchdog_process: Option<Arc<WatchdogProcess>>,
}

/// Owner of the holding thread.
pub(super) struct Holder {
    commands: Publisher<Command, COMMAND_WORDS>,
    reports: Observer<Report, REPORT_WORDS>,
    heartbeat: Heartbeat,
    thread: Option<JoinHandle<ActiveDevice>>,
}

impl Holder {
    /// Starts the thread, without vertical force. Not real-time.
    ///
    /// # Errors
    /// Errors of the thread's start.
    pub(super) fn start(device: ActiveDevice, guard: Guard) -> std::io::Result<Self> {
        let (commands, commanded) = latest(Command::Push(0.0));
        let (publisher, reports) = latest(Averages::default().report(Holding::Changing));
        let Guard { envelope, plausibility, stopper, stop, watchdog_process } = guard;
        let heartbeat = Heartbeat::default();
        let signs = watchdog_process.as_ref().and_then(|process| process.heartbeat_sender().ok());
        start_watchdog(heartbeat.clone(), vec![stopper.clone()], stop.clone(), WATCHDOG_NS, signs)?;
        let thread_heartbeat = heartbeat.clone();
        let hold = move || {
            // The rig detects if the watchdog process has ended.
            let _ = watchdog_process.as_ref().map(|process| process.follow_this_thread());
            let name = "the device of the rig".to_owned();
            let _last_stop = LastStop::arm(vec![stopper], vec![name], thread_heartbeat.clone());
            let device =
                hold(device, envelope, plausibility, &thread_heartbeat, &stop, &commanded, publisher);
            thread_heartbeat.finish();
            let _ = watchdog_process.as_ref().map(|process| process.follow_no_thread());
            device
        };
        let thread = std::thread::Builder::new().name("flotor-rig".to_owned()).spawn(hold)?;
        Ok(Self { commands, reports, heartbeat, thread: Some(thread) })
    }

    /// Ramps the upward force to a new value, N.
    pub(super) fn push(&mut self, force_n: f64) {
        self.commands.publish(&Command::Push(force_n));
    }

    /// Returns the state of the handle.
    ///
    /// # Errors
    /// [`CalibrationError`] if the handle is not held any more.
    pub(super) fn look(&self) -> Result<Report, CalibrationError> {
        let report = loop {
            // A concurrent publish takes nanoseconds: retry.
            if let Some((_, report)) = self.reports.read() {
                break report;
            }
        };
        if self.heartbeat.fired_at().is_some() {
            return Err(CalibrationError::Fault(Fault::Timeout));
        }
        match report.state {
            Holding::Faulted(fault) => Err(CalibrationError::Fault(fault)),
            Holding::Oscillated => Err(CalibrationError::Oscillated),
            Holding::LostContact => Err(CalibrationError::LostContact { height_mm: report.height_m * 1.0e3 }),
            Holding::Changing | Holding::Steady(_) => Ok(report),
        }
    }

    /// Removes the force, ends the thread and deactivates the device; returns the device, `None` if it must be
    /// reopened.
    pub(super) fn stop(&mut self) -> Option<OpenedDevice> {
        self.commands.publish(&Command::End);
        let thread = self.thread.take()?;
        while !thread.is_finished() {
            // Stuck in a device call after the watchdog stopped the device: abandon the thread.
            if self.heartbeat.fired_at().is_some() {
                return None;
            }
            std::thread::sleep(LOOK_FOR_END);
        }
        thread.join().ok()?.deactivate()
    }
}

/// Removes the force and deactivates the device however the procedure ends.
impl Drop for Holder {
    fn drop(&mut self) {
        let _ = self.stop();
    }
}

fn hold(
    mut device: ActiveDevice,
    mut envelope: Envelope,
    mut plausibility: PlausibilityCheck,
    heartbeat: &Heartbeat,
    stop: &StopSwitch,
    commands: &Observer<Command, COMMAND_WORDS>,
    mut reports: Publisher<Report, REPORT_WORDS>,
) -> ActiveDevice {
    // Real-time priority is optional here: late ticks show in the delivered force.
    let _ = enter_real_time(None);
    let period = Duration::from_nanos(PERIOD_NS);
    let started = Instant::now();
    let mut command = Command::Push(0.0);
    let (mut pushed_n, mut ran_away) = (0.0_f64, false);
    let mut state = DeviceState::HOME;
    let mut averages = Averages::default();
    let mut last_ns = 0;
    let mut stale_ticks = 0_u32;
    for index in 0.. {
        #[allow(clippy::cast_possible_truncation)] // five hundred years
        let time_ns = started.elapsed().as_nanos() as u64;
        let tick = Tick { index, time_ns, dt_ns: time_ns - last_ns };
        last_ns = time_ns;
        if let Some((_, newest)) = commands.read() {
            command = newest;
        }
        let commanded_n = if let Command::Push(force_n) = command { force_n } else { 0.0 };
        let left_n = commanded_n - pushed_n;
        if left_n != 0.0 {
            // The last step is the remainder, so that the force equals its target to the bit.
            pushed_n = if left_n.abs() <= RAMP_STEP_N {
                commanded_n
            } else {
                pushed_n + RAMP_STEP_N * left_n.signum()
            };
            averages.begin_anew();
        }
        heartbeat.enter(index, Place::DeviceRead(0));
        let last = state;
        let mut read = device.read(&tick, &mut state);
        // As in a run: an implausible sample counts as stale, and too many as a fault.
        if read == Cycle::Fresh && plausibility.check(&tick, &state).is_err() {
            state = last;
            read = Cycle::Stale;
        }
        if plausibility.trust() == Trust::Lost {
            read = Cycle::Fault(Fault::Protocol);
        }
        stale_ticks = if read == Cycle::Fresh { 0 } else { stale_ticks.saturating_add(1) };
        let gate = if stale_ticks > STALE_TICKS_LIMIT { Gate::SHUT } else { Gate::OPEN };
        if gate == Gate::SHUT {
            averages.begin_anew();
        }
        if read == Cycle::Fresh {
            averages.add(&state);
        }
        let speed_m_per_s = state.twist.linear().z;
        ran_away |= speed_m_per_s.abs() > RUNAWAY_M_PER_S;
        let vertical_n = if ran_away { -BRAKE_NS_PER_M * speed_m_per_s } else { pushed_n };
        let (asked, mut events) = (locked(&state, vertical_n), Events::NONE);
        let commanded = envelope.apply(&asked, gate, &state, &tick, &mut events);
        if events.intersects(Events::FORCE_LIMITED) {
            // A limited force never counts as the commanded one.
            averages.begin_anew();
        }
        heartbeat.enter(index, Place::DeviceWrite(0));
        let written = device.write(&tick, &commanded);
        heartbeat.enter(index, Place::Waiting);
        let faulted = [read, written].into_iter().find_map(|cycle| match cycle {
            Cycle::Fault(fault) => Some(fault),
            Cycle::Fresh | Cycle::Stale => None,
        });
        // The watchdog has stopped the device, or will stop it within a millisecond.
        let fault = faulted.or(stop.emergency().map(|_| Fault::EmergencyStop));
        if fault == Some(Fault::EmergencyStop) {
            stop.press(EmergencySource::Device);
        }
        let doing = match fault {
            Some(fault) => Holding::Faulted(fault),
            None if envelope.is_unstable() => Holding::Oscillated,
            None if ran_away => Holding::LostContact,
            None if averages.are_full() => Holding::Steady(pushed_n),
            None => Holding::Changing,
        };
        reports.publish(&averages.report(doing));
        let is_let_go = command == Command::End && (pushed_n == 0.0 || ran_away);
        if fault.is_some() || is_let_go {
            break;
        }
        // Skip late ticks: there is nothing to catch up.
        let next = u32::try_from(time_ns / PERIOD_NS + 1).unwrap_or(u32::MAX);
        std::thread::sleep((started + period * next).saturating_duration_since(Instant::now()));
    }
    device
}

/// Means of height and delivered force over successive intervals: the handle is at rest if the last two agree.
#[derive(Default)]
struct Averages {
    /// Last two complete means, newest first, each as height, m, and delivered force, N; `None` until there are two.
    full: Option<[(f64, f64); 2]>,
    last: Option<(f64, f64)>,
    height_m: Mean,
    delivered_n: Mean,
    samples: u64,
    means: u64,
    restless: u64,
    /// Saturated ticks of the mean in progress, and of the last two complete means.
    saturated: [u64; 3],
}

impl Averages {
    /// Discards the means measured under another force.
    fn begin_anew(&mut self) {
        *self = Self { means: self.means, restless: self.restless, ..Self::default() };
    }

    fn are_full(&self) -> bool {
        self.full.is_some()
    }

    fn add(&mut self, state: &DeviceState) {
        self.height_m.add(state.pose.position().z);
        self.delivered_n.add(state.delivered.force().z);
        self.saturated[0] += u64::from(state.conditions.contains(Conditions::SATURATED));
        self.samples += 1;
        if self.samples == AVERAGED_TICKS {
            let mean = (self.height_m.value(), self.delivered_n.value());
            self.full = self.last.map(|last| [mean, last]);
            self.last = Some(mean);
            (self.height_m, self.delivered_n, self.samples) = (Mean::default(), Mean::default(), 0);
            self.means += 1;
            let [now, last, _] = self.saturated;
            self.saturated = [0, now, last];
            let is_at_rest = self.full.is_some_and(|[(height_m, delivered_n), (before_m, before_n)]| {
                (height_m - before_m).abs() <= REST_M && (delivered_n - before_n).abs() <= STEADY_N
            });
            self.restless += u64::from(!is_at_rest);
        }
    }

    fn report(&self, state: Holding) -> Report {
        let (means, restless) = (self.means, self.restless);
        let [_, last, before] = self.saturated;
        let saturated = last + before;
        match self.full {
            Some([(height_m, delivered_n), (before_m, _)]) => {
                let moved_m = (height_m - before_m).abs();
                Report { state, height_m, moved_m, delivered_n, means, restless, saturated }
            }
            None => {
                let (height_m, moved_m) = (self.height_m.value(), f64::INFINITY);
                Report { state, height_m, moved_m, delivered_n: 0.0, means, restless, saturated }
            }
        }
    }
}
