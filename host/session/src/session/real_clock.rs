//! Loop on the real clock, in a separate thread; the caller's thread calls the observers and watches the loop.

use super::controls::ChangeLog;
use super::latch;
use super::observer::Taps;
use super::outcome::Finished;
use super::plugin_report::PluginNames;
use super::prepared_loop::{PreparedLoop, activate_here};
use super::stop_time::StopTimer;
use super::{Controls, Guardian, LatchGuard, Observer, RunError};
use crate::calls::{Call, CallError, Progress, Unresponsive, abandon, end_limit, limit};
use crate::long_call::Exceeded;
use crate::scene::Pacing;
use flotor_core::PluginIndex;
use flotor_core::trace::TickRecord;
use flotor_loader::Stopper;
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{
    Core, Heartbeat, Loop, Producer, RunEnd, Schedule, SpinWindow, StopSwitch, Stuck, drain, enter_real_time,
    queue, start_watchdog,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Capacity of the record queue between loop and observers: four seconds of one device at 1 kHz.
const RING_RECORDS: usize = 4096;
/// Timeout for the end of a watchdog that is not needed any more.
const WATCHDOG_END: Duration = Duration::from_millis(50);
/// Poll interval of the observers in real time.
const OBSERVER_PERIOD: Duration = Duration::from_millis(5);
/// Grace period for a stuck loop after the watchdog has stopped its device: a tick that was only late ends by itself, and the run
/// then has a complete outcome.
const COME_BACK: Duration = Duration::from_millis(500);

/// Configuration of a run that only the real clock needs.
pub(super) struct RealClock {
    pub(super) pacing: Pacing,
    pub(super) core: Option<Core>,
    pub(super) watchdog_ns: u64,
    /// Process that stops the devices if this process ends.
    pub(super) watchdog_process: Option<Arc<WatchdogProcess>>,
    /// True if the run must stop when the watchdog process has ended.
    pub(super) requires_independent_stop: bool,
    /// Emergency-stop latch; `None` on the virtual clock, where no hand is on a device.
    pub(super) latch: Option<LatchGuard>,
}

/// Runs the loop in a separate thread until it ends; this thread calls the observers meanwhile.
pub(super) fn run(
    prepared: PreparedLoop,
    clock: RealClock,
    mut changes: ChangeLog,
    controls: &Controls,
    observer: &mut dyn Observer,
    stop: &StopSwitch,
) -> Result<Finished, RunError> {
    let (mut records, mut received) = queue(RING_RECORDS);
    let mut guardian = Guardian::of(clock.watchdog_process.as_ref(), clock.requires_independent_stop);
    // Watch before the final check of the latch, so that no press is missed.
    let latch = clock.latch.as_ref().map(|latch| latch.watch(stop)).transpose();
    let _latch = latch.map_err(|_| RunError::NoThread(latch::WATCH))?;
    let mut requested = prepared.standby.observers().request(observer.demand());
    let mut watch = LoopWatch::of(&prepared, clock.watchdog_ns);
    let (progress, stopping, loop_stop) = (watch.progress.clone(), watch.stopping.clone(), stop.clone());
    // Not scoped: a thread that is stuck in plugin code must be abandoned.
    let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
    let servo_thread =
        thread.spawn(move || run_loop(prepared, clock, &loop_stop, &mut records, &progress, &stopping));
    let servo_thread = servo_thread.map_err(|_| RunError::NoThread("the loop"))?;
    while !servo_thread.is_finished() {
        requested.change_to(observer.demand());
        drain(&mut received, |record| changes.deliver(&record, observer));
        controls.sweep();
        guardian.check(stop);
        watch.check()?;
        std::thread::sleep(OBSERVER_PERIOD);
    }
    let finished = servo_thread.join().map_err(|_| RunError::Thread("panicked"))??;
    drain(&mut received, |record| changes.deliver(&record, observer));
    Ok(Finished { end: guardian.end(finished.end), warning: guardian.warning(), ..finished })
}

/// Device that is being stopped in the loop's thread; another thread polls it, because `safe_stop` may hang as well.
#[derive(Clone, Default)]
struct Stopping(Arc<AtomicUsize>);

impl Stopping {
    /// Marks the start of `safe_stop` of a device.
    fn enter(&self, device: usize) {
        self.0.store(device + 1, Ordering::Relaxed);
    }

    /// Marks that all devices are stopped.
    fn exit(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    fn device(&self) -> Option<PluginIndex> {
        self.0.load(Ordering::Relaxed).checked_sub(1).map(PluginIndex::at)
    }

    /// Returns the device that is being stopped, with the time of the first poll that found this device; `earlier` is the result of
    /// the previous poll.
    fn poll(&self, earlier: Option<(PluginIndex, Instant)>) -> Option<(PluginIndex, Instant)> {
        let device = self.device()?;
        earlier.filter(|(before, _)| *before == device).or_else(|| Some((device, Instant::now())))
    }
}

/// Energises the devices, runs the loop to its end, and stops the devices, on the loop's thread.
fn run_loop(
    prepared: PreparedLoop,
    clock: RealClock,
    stop: &StopSwitch,
    records: &mut Producer<TickRecord>,
    progress: &Progress,
    stopping: &Stopping,
) -> Result<Finished, RunError> {
    let PreparedLoop { standby, plugins, mut taps, period_ns, duration_ns } = prepared;
    let RealClock { pacing, core, watchdog_ns, watchdog_process, latch, .. } = clock;
    let real_time = enter_real_time(core);
    // The caller's thread notices the end of the watchdog process.
    let signs = watchdog_process.as_ref().and_then(|process| {
        let _ = process.follow_this_thread();
        process.heartbeat_sender().ok()
    });
    let spin = (pacing == Pacing::Host).then(|| SpinWindow::measure(period_ns));
    let (stoppers, heartbeat) = (standby.stoppers(), standby.heartbeat());
    // Last check, after all steps that take time.
    latch.as_ref().map_or(Ok(()), LatchGuard::check)?;
    let servo = activate_here(standby, &plugins, progress)?;
    let schedule = match spin {
        Some(window) => Schedule::start_real(period_ns, window),
        None => Schedule::start_paced(period_ns),
    };
    let watchdog = start_watchdog(heartbeat, stoppers.clone(), stop.clone(), watchdog_ns, signs);
    let mut runner = Loop::new(servo, schedule, duration_ns).releasing();
    // Without a watchdog the loop does not tick.
    let (dropped_records, last_tick) = match &watchdog {
        Ok(_) => tick(&mut runner, stop, &mut taps, records),
        Err(_) => (0, Duration::ZERO),
    };
    let timer = stop_devices(runner.end(), last_tick, stop, &stoppers, stopping);
    runner.servo().heartbeat().finish();
    // From here on nothing is energised.
    drop(watchdog_process);
    wait_for_end_of(&watchdog.map_err(|_| RunError::NoThread("the watchdog"))?);
    let finished = Finished::of(runner, dropped_records, real_time);
    let is_emergency = matches!(finished.end, RunEnd::EmergencyStop(_));
    let stop_time = is_emergency.then(|| timer.since_request(stop, latch.as_ref()));
    Ok(Finished { stop_time, ..finished })
}

/// Runs the loop to its end; returns the number of dropped records, and the compute time of the last tick. If the queue is full,
/// records are dropped: observers never delay the loop.
fn tick(
    runner: &mut Loop,
    stop: &StopSwitch,
    taps: &mut Taps,
    records: &mut Producer<TickRecord>,
) -> (u64, Duration) {
    let (mut dropped_records, mut tick_ns) = (0, 0);
    while runner.end().is_none() {
        runner.advance(stop, |record| {
            taps.publish(record);
            tick_ns = record.compute_ns;
            dropped_records += u64::from(records.push(*record).is_err());
        });
    }
    (dropped_records, Duration::from_nanos(tick_ns))
}

/// Stops the devices on the loop's thread, while the watchdog is still running.
fn stop_devices(
    end: Option<RunEnd>,
    last_tick: Duration,
    stop: &StopSwitch,
    stoppers: &[Stopper],
    stopping: &Stopping,
) -> StopTimer {
    let mut timer = StopTimer::start(last_tick);
    // For an emergency stop by a button or by the device: press the switch first, so that the latch is pressed even if `safe_stop`
    // hangs.
    if let Some(RunEnd::EmergencyStop(source)) = end {
        stop.press(source);
    }
    for (device, stopper) in stoppers.iter().enumerate() {
        stopping.enter(device);
        stopper.safe_stop();
        timer.stopped();
    }
    stopping.exit();
    timer
}

/// Waits until the watchdog, which polls every millisecond, has released the devices, so that the calls that close them are the ones
/// with a time limit. Has a timeout: the watchdog may be in a `safe_stop` that hangs.
fn wait_for_end_of(watchdog: &JoinHandle<()>) {
    let since = Instant::now();
    while !watchdog.is_finished() && since.elapsed() < WATCHDOG_END {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Watch of the loop's thread, for a call that does not return.
struct LoopWatch {
    names: PluginNames,
    stoppers: Vec<Stopper>,
    heartbeat: Heartbeat,
    watchdog_limit: Duration,
    progress: Progress,
    stopping: Stopping,
    /// Device that is being stopped, and the time of the first poll that found this device.
    stopping_since: Option<(PluginIndex, Instant)>,
    /// Place where the watchdog found the loop stuck, and the time of the poll that noticed it.
    fired: Option<(Stuck, Instant)>,
}

impl LoopWatch {
    fn of(prepared: &PreparedLoop, watchdog_ns: u64) -> Self {
        Self {
            names: PluginNames::of(&prepared.plugins),
            stoppers: prepared.standby.stoppers(),
            heartbeat: prepared.standby.heartbeat(),
            watchdog_limit: Duration::from_nanos(watchdog_ns),
            progress: Progress::default(),
            stopping: Stopping::default(),
            stopping_since: None,
            fired: None,
        }
    }

    /// Checks the loop's thread, and abandons a thread whose call does not return.
    ///
    /// # Errors
    /// [`RunError::Calls`], [`RunError::Hung`].
    fn check(&mut self) -> Result<(), RunError> {
        if let Err(hung) = self.progress.check(limit()) {
            // Other devices may be energised by now.
            self.stoppers.iter().for_each(Stopper::safe_stop);
            return Err(CallError::from(hung).into());
        }
        self.stopping_since = self.stopping.poll(self.stopping_since);
        if let Some((device, since)) = self.stopping_since
            && since.elapsed() > end_limit()
        {
            abandon();
            let who = self.names.name(device);
            let hung = Unresponsive { who, call: Call::SafeStop, limit: end_limit() };
            return Err(CallError::from(hung).into());
        }
        self.fired = self.fired.or_else(|| self.heartbeat.fired_at().map(|stuck| (stuck, Instant::now())));
        if let Some((stuck, since)) = self.fired
            && since.elapsed() > COME_BACK
        {
            abandon();
            return Err(RunError::hung(stuck, &self.names, Exceeded::Watchdog(self.watchdog_limit)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If the second `safe_stop` hung, the error named the first device, and the time of its stop counted too.
    #[test]
    fn a_stop_that_hangs_is_that_of_the_device_in_safe_stop() {
        let stopping = Stopping::default();
        assert_eq!(stopping.poll(None), None);
        stopping.enter(0);
        let first = stopping.poll(None);
        assert_eq!(first.map(|(device, _)| device), Some(PluginIndex::at(0)));
        assert_eq!(stopping.poll(first), first, "the time of the first poll counts");
        stopping.enter(1);
        let second = stopping.poll(first);
        assert_eq!(second.map(|(device, _)| device), Some(PluginIndex::at(1)));
        assert!(second.map(|(_, since)| since) >= first.map(|(_, since)| since));
        stopping.exit();
        assert_eq!(stopping.poll(second), None);
    }
}
