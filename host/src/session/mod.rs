//! From a scene to a run: loads what the scene names, pairs it, runs the loop, lets others watch and change it.

mod choice;
mod controls;
mod prepare;
mod standby;
mod steps;

pub use controls::{ControlError, Controls, Misbehaved, NewValue};
pub(crate) use prepare::prepare_model;
pub use steps::Steps;

use crate::coupling::{Line, Patience};
use crate::record::Change;
use crate::registry::{LookupError, Registry};
use crate::scene::{MOST_DEVICES, Pacing, Scene, SceneError};
use crate::servo::{
    Cause, Clock, Core, Coupled, CouplingOutcome, EmergencySource, Envelope, Forces, Heartbeat, ModelHealth,
    PaceLost, ParameterQueue, Place, RealTimeReport, RunConfig, RunState, Schedule, Servo, SpinWindow,
    StopSwitch, Stuck, Timing, enter_real_time, exchange, start_watchdog,
};
use crate::trace::{RECORD_WORDS, TickRecord};
use controls::{ChangeLog, Parts};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{ActiveDevice, LoadError, Metadata, Stopper};
use flotor_hal::{DVec3, EnergyLedger, Fault, LoopConfig, Parameter, SampleWait};
use flotor_live::WrenchLimits;
use prepare::Scheduled;
use standby::Standby;
use std::time::{Duration, Instant};

/// How a scene is to be run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Real or virtual time.
    pub clock: Clock,
    /// Seed of everything random.
    pub seed: u64,
}

/// Why a run did not start or did not end well.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene says something that cannot be.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A plugin is unknown or was refused.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// A plugin said no.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// Device and scene do not fit; all mismatches at once.
    #[error("the scene does not fit the device `{device}`: {}", mismatches.join("; "))]
    Mismatch {
        /// Id of the device.
        device: String,
        /// What does not fit, each with a remedy.
        mismatches: Vec<String>,
    },
    /// The servo's thread could not be started or died.
    #[error("the servo thread {0}; nothing was moved")]
    Thread(&'static str),
    /// Somebody did not come back to the loop; the watchdog has stopped the device.
    #[error(
        "`{who}` did not come back from {} in tick {}; the watchdog stopped the device after {} ms",
        stuck.place.call(), stuck.tick, limit_ns / 1_000_000
    )]
    Hung {
        /// Name in the scene, or "device" or "host".
        who: String,
        /// Where it is.
        stuck: Stuck,
        /// How long the watchdog waits, ns.
        limit_ns: u64,
    },
}

/// A plugin in a run, for reports and recordings.
#[derive(Clone, Debug)]
pub struct PluginReport {
    /// Name in the scene, of device or model.
    pub name: String,
    /// What the plugin says about itself.
    pub metadata: Metadata,
    /// What it can be told.
    pub schema: &'static [Parameter],
    /// What scene and command line set, as written, in order.
    pub settings: Vec<(String, String)>,
    /// Every parameter with the value in force before the run, as text.
    pub parameters: Vec<(String, String)>,
}

/// Looks at every tick, off the loop.
pub trait Observer {
    /// What a tick has left behind at one device: tick after tick, and within a tick device after device. Not real-time.
    fn observe(&mut self, record: &TickRecord);

    /// A parameter that changed, before the tick that saw it first. Not real-time.
    fn change(&mut self, _change: &Change) {}
}

/// A scene ready to run: everything loaded, paired and opened, nothing energised.
pub struct Session {
    standby: Standby,
    controls: Controls,
    changes: ChangeLog,
    clock: Clock,
    pacing: Pacing,
    period_ns: u64,
    duration_ns: u64,
    watchdog_ns: u64,
    core: Option<Core>,
    plugins: Vec<PluginReport>,
    lines: Vec<(String, Line)>,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// The duration is over.
    Finished,
    /// Somebody asked it to stop.
    Stopped,
    /// The device faulted.
    DeviceFault(Fault),
    /// The emergency stop was pressed.
    EmergencyStop(EmergencySource),
    /// The device sets the pace, and it is a faster one than the scene says: this many samples a second.
    TooFast(u32),
    /// A tick took so long that the watchdog stopped the device; then it came back.
    Watchdog(Stuck),
}

impl RunEnd {
    /// What it means that a device does not set the pace it should.
    fn without_pace(lost: PaceLost) -> Self {
        match lost {
            PaceLost::NotPaced => Self::DeviceFault(Fault::Broken),
            PaceLost::TooFast { samples, elapsed_ns } => {
                let per_s = samples.saturating_mul(1_000_000_000) / elapsed_ns.max(1);
                Self::TooFast(u32::try_from(per_s).unwrap_or(u32::MAX))
            }
        }
    }

    /// What the last state of a run means for those who asked for it.
    fn of(run: RunState, heart: &Heartbeat) -> Self {
        match (run, heart.bitten()) {
            (RunState::Faulted(Cause::Device(fault)), _) => Self::DeviceFault(fault),
            (RunState::Faulted(Cause::Watchdog), Some(stuck)) => Self::Watchdog(stuck),
            (RunState::EmergencyStopped(source), _) => Self::EmergencyStop(source),
            _ => Self::Stopped,
        }
    }
}

/// What is known after a run.
pub struct Outcome {
    /// How it ended.
    pub end: RunEnd,
    /// How time was kept.
    pub timing: Timing,
    /// Time from the first deadline to the end of the last period, ns (virtual clock: virtual time).
    pub elapsed_ns: u64,
    /// Wall-clock time, s.
    pub wall_s: f64,
    /// Ticks whose records were dropped because an observer was too slow (real clock only).
    pub dropped_records: u64,
    /// What the system granted.
    pub real_time: RealTimeReport,
    /// What the devices say at the end, in the scene's order.
    pub devices: Vec<DeviceOutcome>,
    /// What has become of each coupling, in the scene's order.
    pub couplings: Vec<CouplingOutcome>,
    /// Name, health and last words of each model the run began with.
    pub models: Vec<(String, ModelHealth, String)>,
    /// Of the plugins that took the place of a model later, those that did not behave.
    pub misbehaved: Vec<Misbehaved>,
}

impl Outcome {
    /// Which device faulted, and its last words.
    #[must_use]
    pub fn faulted(&self) -> Option<(usize, &str)> {
        let mut devices = self.devices.iter().enumerate();
        let (number, device) = devices.find(|(_, device)| device.fault.is_some())?;
        Some((number, device.words.as_str()))
    }
}

/// What is known of a device after a run.
#[derive(Clone, Debug)]
pub struct DeviceOutcome {
    /// The first fault it reported.
    pub fault: Option<Fault>,
    /// Its own energy account, where it keeps one.
    pub ledger: Option<EnergyLedger>,
    /// Its last words; empty if it had no reason to say any.
    pub words: String,
}

/// Records that fit between loop and observers: four seconds at 1 kHz.
const RING_RECORDS: usize = 4096;
/// Ticks run between two looks of the observers on the virtual clock.
const VIRTUAL_BATCH: usize = 1024;
/// How often observers look at a loop in real time.
const OBSERVER_PERIOD: Duration = Duration::from_millis(5);
/// How long a loop whose device the watchdog has stopped may take to come back before it is given up: a tick that
/// was only late ends by itself and leaves its report.
const COME_BACK: Duration = Duration::from_millis(500);

impl Session {
    /// Loads, checks and opens everything a scene names, and nothing else. Not real-time.
    ///
    /// # Errors
    /// [`RunError`].
    pub fn prepare(scene: &Scene, registry: &Registry, options: &RunOptions) -> Result<Self, RunError> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 100 Hz to 10 kHz
        let period_ns = (1.0e9 / scene.rate_hz).round() as u64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
        let duration_ns = (scene.duration_s * 1.0e9).round() as u64;
        let config = LoopConfig { period_ns, seed: options.seed };

        let mut plugins = Vec::new();
        let mut opened = Vec::new();
        for device in &scene.devices {
            let (device, report) = prepare::open_device(registry, device)?;
            opened.push(device);
            plugins.push(report);
        }
        let mut models = Vec::new();
        for model in &scene.models {
            let (layer, report) = prepare_model(registry, model, &config, options.clock)?;
            models.push((usize::from(model.device), layer));
            plugins.push(report);
        }
        for (number, (device, opened)) in (0..).zip(scene.devices.iter().zip(&opened)) {
            let mismatches = prepare::pair(scene, number, &opened.capabilities, opened.device.can_pace());
            if !mismatches.is_empty() {
                return Err(RunError::Mismatch { device: device.plugin.plugin.clone(), mismatches });
            }
        }
        let parts = Parts::new(&plugins);
        let Scheduled { changes, replacements } =
            prepare::schedule(scene, &parts, registry, &config, options.clock)?;
        let room = models.len() + replacements.len();
        let (parameters, sender, reports) = ParameterQueue::new(changes, room);
        let (exchange, workshop) = exchange(models.len(), replacements);
        let controls = Controls::new(parts.clone(), sender, &scene.models, (config, options.clock), workshop);

        let devices = opened.into_iter().map(|opened| {
            let envelope = Envelope::new(&scene.limits, &scene.boundary, &opened.capabilities, period_ns);
            (opened, envelope)
        });
        let devices: Vec<_> = devices.collect();
        #[allow(clippy::cast_precision_loss)] // a period is far below 2^53 ns
        let period_s = period_ns as f64 * 1.0e-9;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a minute
        let [ramp_ns, watchdog_ns] =
            [scene.limits.ramp_s, scene.limits.watchdog_s].map(|seconds| (seconds * 1.0e9).round() as u64);
        // A partner on another host is watched like the loop itself.
        let patience = Patience { silence_ns: watchdog_ns, fade_ns: ramp_ns };
        let mut lines = Vec::new();
        let couplings = scene.couplings.iter().map(|coupling| {
            let (coupled, line) = Coupled::new(coupling, period_s, patience);
            lines.extend(line.map(|line| (coupling.name.clone(), line)));
            coupled
        });
        let forces = Forces::new(devices.len(), models, couplings.collect());
        let emergency_buttons = scene.limits.emergency_buttons;
        let run = RunConfig { period_ns, ramp_ns, held_up_ns: watchdog_ns, emergency_buttons };
        Ok(Self {
            standby: Standby::new(devices, forces, parameters, exchange, config, run),
            controls,
            changes: ChangeLog::new(parts, reports),
            clock: options.clock,
            pacing: scene.pacing,
            period_ns,
            duration_ns,
            watchdog_ns,
            core: None,
            plugins,
            lines,
        })
    }

    /// The same with the loop on this core, on the real clock.
    #[must_use]
    pub fn on_core(self, core: Option<Core>) -> Self {
        Self { core, ..self }
    }

    /// The loop itself, its devices energised, for whoever paces it differently; the stoppers must be used before it is
    /// dropped. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device says no; then none is energised.
    pub(crate) fn into_loop(self) -> Result<(Servo, Vec<Stopper>), RunError> {
        let stoppers = self.standby.stoppers();
        Ok((self.standby.activate()?, stoppers))
    }

    /// The core the loop is to run on, if one is named.
    pub(crate) fn core(&self) -> Option<Core> {
        self.core
    }

    /// Nominal time between ticks, ns.
    pub(crate) fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// The plugins of this run with every parameter in force.
    #[must_use]
    pub fn plugins(&self) -> &[PluginReport] {
        &self.plugins
    }

    /// The most that may reach a hand at any device: the tighter of what scene and device allow.
    #[must_use]
    pub fn limits(&self) -> WrenchLimits {
        let finite = |most: DVec3| most.to_array().map(|limit| limit.is_finite().then_some(limit));
        let [force_n, torque_nm] = self.standby.most().map(finite);
        WrenchLimits { force_n, torque_nm }
    }

    /// The couplings whose other end is on another host, by name, each with the line on which its news is to be carried.
    /// Given once; an end whose line nobody takes is never heard of, and asks for nothing.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// The handle by which other threads change parameters of the run.
    #[must_use]
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Runs until the duration is over, somebody uses `stop`, or the device faults.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device refuses to be energised, [`RunError::Thread`] if the servo's thread cannot be had,
    /// [`RunError::Hung`] if it does not come back: it is left behind then, and the process should end soon.
    pub fn run(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Outcome, RunError> {
        let started = Instant::now();
        let names: Vec<String> = self.plugins.iter().map(|plugin| plugin.name.clone()).collect();
        let controls = self.controls.clone();
        let finished = match self.clock {
            Clock::Virtual => self.run_virtual(observer, stop)?,
            Clock::Real => self.run_real(observer, stop)?,
        };
        let Finished { mut servo, end, elapsed_ns, dropped_records, real_time } = finished;
        let told = |(device, fault): (&mut ActiveDevice, Option<Fault>)| DeviceOutcome {
            fault,
            ledger: device.energy_ledger(),
            words: device.last_message(),
        };
        let devices: Vec<DeviceOutcome> = servo.devices().map(told).collect();
        let couplings = servo.forces().coupling_outcomes();
        let (health, misbehaved) = controls.settle(servo.forces().reports());
        let models = names.into_iter().skip(devices.len()).zip(health);
        let models = models.map(|(name, (health, words))| (name, health, words)).collect();
        let timing = servo.into_timing();
        let wall_s = started.elapsed().as_secs_f64();
        Ok(Outcome {
            end,
            timing,
            elapsed_ns,
            wall_s,
            dropped_records,
            real_time,
            devices,
            couplings,
            models,
            misbehaved,
        })
    }

    /// Same tick, no waiting: observers look between batches, so that a slow one slows the run and loses nothing.
    fn run_virtual(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Finished, RunError> {
        let Session { standby, controls, mut changes, period_ns, duration_ns, .. } = self;
        let stoppers = standby.stoppers();
        let mut runner = Runner::new(standby.activate()?, Schedule::start_virtual(period_ns), duration_ns);
        // A tick may end a batch with a record for each device.
        let mut batch = Vec::with_capacity(VIRTUAL_BATCH + usize::from(MOST_DEVICES));
        while runner.end.is_none() {
            while batch.len() < VIRTUAL_BATCH && runner.end.is_none() {
                runner.next(stop, |record| batch.push(*record));
            }
            if runner.end.is_some() {
                stoppers.iter().for_each(Stopper::safe_stop);
            }
            for record in batch.drain(..) {
                changes.up_to(record.tick, |change| observer.change(change));
                observer.observe(&record);
            }
            controls.sweep();
            runner.servo.pause();
        }
        Ok(runner.finish(0, RealTimeReport::not_asked()))
    }

    /// The loop on a thread of its own; this one lets the observers look.
    fn run_real(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Finished, RunError> {
        let (mut sender, mut receiver) = flotor_sync::ring::<TickRecord, RECORD_WORDS>(RING_RECORDS);
        let Session {
            standby,
            controls,
            mut changes,
            pacing,
            period_ns,
            duration_ns,
            watchdog_ns,
            core,
            plugins,
            ..
        } = self;
        let mut look = |record: TickRecord| {
            changes.up_to(record.tick, |change| observer.change(change));
            observer.observe(&record);
        };
        let heart = standby.heart();
        let loop_stop = stop.clone();
        // Not scoped: a thread that is stuck in a plugin has to be left behind.
        let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
        let loop_heart = heart.clone();
        let servo_thread = thread.spawn(move || {
            let real_time = enter_real_time(core);
            let spin = match pacing {
                Pacing::Host => Some(SpinWindow::measure(period_ns)),
                Pacing::Device => None,
            };
            // Last of all that takes time.
            let stoppers = standby.stoppers();
            let servo = standby.activate()?;
            let schedule = match spin {
                Some(window) => Schedule::start_real(period_ns, window),
                None => Schedule::start_paced(period_ns),
            };
            let watchdog = start_watchdog(loop_heart, stoppers.clone(), loop_stop.clone(), watchdog_ns);
            let mut runner = Runner::new(servo, schedule, duration_ns).releasing();
            // Without a watchdog nothing is moved.
            if watchdog.is_err() {
                runner.end = Some(RunEnd::Stopped);
            }
            while runner.end.is_none() {
                runner.next(&loop_stop, |record| {
                    // A full ring is counted by the ring itself: observers never hold up the loop.
                    let _ = sender.push(record);
                });
            }
            // Here, whatever the thread that looks on is at, and while the watchdog still watches.
            stoppers.iter().for_each(Stopper::safe_stop);
            runner.servo.heart().finish();
            watchdog.map_err(|_| RunError::Thread("got no watchdog"))?;
            Ok::<_, RunError>(runner.finish(0, real_time))
        });
        let servo_thread = servo_thread.map_err(|_| RunError::Thread("could not be started"))?;
        let mut bitten = None;
        while !servo_thread.is_finished() {
            receiver.drain(&mut look);
            controls.sweep();
            bitten = bitten.or_else(|| heart.bitten().map(|stuck| (stuck, Instant::now())));
            if let Some((stuck, since)) = bitten
                && since.elapsed() > COME_BACK
            {
                return Err(hung(stuck, &plugins, watchdog_ns));
            }
            std::thread::sleep(OBSERVER_PERIOD);
        }
        let finished = servo_thread.join().map_err(|_| RunError::Thread("panicked"))??;
        receiver.drain(&mut look);
        Ok(Finished { dropped_records: receiver.dropped(), ..finished })
    }
}

/// Whose fault a stuck loop is, by name.
fn hung(stuck: Stuck, plugins: &[PluginReport], limit_ns: u64) -> RunError {
    let name = |index: usize| plugins.get(index).map_or_else(String::new, |plugin| plugin.name.clone());
    let devices = plugins.iter().filter(|plugin| plugin.metadata.kind == PluginKind::Device).count();
    let who = match stuck.place {
        Place::Model(index) => name(devices + index),
        Place::DeviceWait(device) | Place::DeviceRead(device) | Place::DeviceWrite(device) => {
            name(device.into())
        }
        Place::Host | Place::Waiting => "host".to_owned(),
    };
    RunError::Hung { who, stuck, limit_ns }
}

/// The loop proper, the same for both clocks.
struct Runner {
    servo: Servo,
    schedule: Schedule,
    duration_ns: u64,
    /// From when on force fades out because the duration will be over.
    release_ns: u64,
    end: Option<RunEnd>,
}

struct Finished {
    servo: Servo,
    end: RunEnd,
    elapsed_ns: u64,
    dropped_records: u64,
    real_time: RealTimeReport,
}

impl Runner {
    fn new(servo: Servo, schedule: Schedule, duration_ns: u64) -> Self {
        Self { servo, schedule, duration_ns, release_ns: u64::MAX, end: None }
    }

    /// The same with an end that a hand can bear: force is gone when the duration is over, and does not drop then. On the
    /// virtual clock there is no hand.
    fn releasing(self) -> Self {
        Self { release_ns: self.duration_ns.saturating_sub(self.servo.ramp_ns()), ..self }
    }

    /// Waits for and runs the next tick, or sets `end`; `leave` gets what it leaves behind. Real-time: bounded, no
    /// allocation.
    #[inline]
    fn next(&mut self, stop: &StopSwitch, leave: impl FnMut(&TickRecord)) {
        if self.schedule.next_time_ns() >= self.duration_ns {
            self.end = Some(RunEnd::Finished);
            return;
        }
        let Self { servo, schedule, release_ns, .. } = self;
        // The first device sets the pace, if one does.
        let next = schedule.next_index();
        let wait_for_sample = |timeout_ns| {
            servo.heart().enter(next, Place::DeviceWait(0));
            servo
                .devices()
                .next()
                .map_or(SampleWait::NotPaced, |(device, _)| device.wait_for_sample(timeout_ns))
        };
        let due = match schedule.wait(wait_for_sample) {
            Ok(due) => due,
            Err(lost) => {
                self.end = Some(RunEnd::without_pace(lost));
                return;
            }
        };
        if due.tick.time_ns >= *release_ns {
            servo.release(&due.tick);
        }
        servo.tick(&due, stop, leave);
        if servo.run().is_over() {
            let end = RunEnd::of(servo.run(), servo.heart());
            // Lost samples end a release early; nobody has asked for one then.
            let is_time_up = end == RunEnd::Stopped && !stop.is_stop_asked();
            self.end = Some(if is_time_up { RunEnd::Finished } else { end });
        }
    }

    fn finish(self, dropped_records: u64, real_time: RealTimeReport) -> Finished {
        let end = self.end.unwrap_or(RunEnd::Stopped);
        let elapsed_ns = self.schedule.finish();
        Finished { servo: self.servo, end, elapsed_ns, dropped_records, real_time }
    }
}
