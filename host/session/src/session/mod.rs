//! From a scene to a run: loads what the scene names, pairs it, runs the loop, lets others watch and change it.

mod ceiling;
mod choice;
mod controls;
mod epilogue;
mod latch;
mod lockstep;
mod prepare;
mod remains;
mod steps;
mod stop_time;
mod stop_without_host;
mod unguarded;
mod virtual_loop;

pub use ceiling::{Strength, StrongDevice};
pub use controls::{ControlError, Controls, Misbehaved, NewValue};
pub use latch::{LatchGuard, LatchWatch, StopReach};
pub use lockstep::Lockstep;
pub use prepare::{check_plugins, prepare_model};
pub use remains::Remains;
pub use steps::Steps;
pub use stop_time::StopTime;
pub use stop_without_host::{StopWithoutHost, WatchdogStart, start_watchdog_process};
pub use unguarded::Guardian;

use crate::calls::{Call, CallError, EndReserve, Progress, Unresponsive, end_limit, leave_behind, limit};
use crate::long_call::Exceeded;
use crate::registry::{LookupError, Registry};
use crate::scene::{Isolation, Pacing, Scene, SceneError};
use ceiling::{norm_notice, under_ceiling};
use controls::{ChangeLog, PluginTable};
use epilogue::Epilogue;
use flotor_core::Change;
use flotor_core::ModelOutputs;
use flotor_core::demand::{ObserverDemand, felt_within};
use flotor_core::limits::{Bound, Limits};
use flotor_core::plausibility::ImplausibleSamples;
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_coupling::{Line, Patience, Reach};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{LoadError, Metadata, Stopper};
use flotor_hal::{
    Axes, Capabilities, Demand, Embodiment, EnergyLedger, Fault, LoopConfig, Parameter, SoftRange,
};
use flotor_hal::{Pose, Twist, Wrench};
use flotor_live::{Directory, Pressed, WrenchLimits};
use flotor_servo::last_stop::TakenSignals;
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{
    Clock, Core, Coupled, CouplingOutcome, Envelope, EnvelopeEffects, Forces, Guarded, Loop, ModelHealth,
    ParameterQueue, Place, RealTimeReport, RunConfig, RunEnd, Schedule, Servo, SpinWindow, Standby,
    StopSwitch, Stuck, THREAD_ADVICE, Timing, drain, enter_real_time, queue, start_watchdog, swap_queues,
};
use prepare::{Scheduled, activate, activate_here};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use stop_time::StopTimer;

/// How a scene is to be run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Real or virtual time.
    pub clock: Clock,
    /// Seed of all random numbers.
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
    /// A plugin did not return from a call before the run.
    #[error(transparent)]
    Calls(#[from] CallError),
    /// The servo thread died.
    #[error("the servo thread {0}; no device was moved")]
    Thread(&'static str),
    /// The system has no thread for a part of the run, which is named.
    #[error("cannot start the thread for {0}, so no device was moved; {THREAD_ADVICE}")]
    NoThread(&'static str),
    /// The scene requires a stop that does not depend on this process, and there is none.
    #[error(
        "no watchdog process: {0}; `[limits] require_independent_stop = true` requires one; correct the cause, or remove that line"
    )]
    WatchdogProcess(std::io::Error),
    /// Only the watchdog process stops a device when this process is gone, and a kill of one control group ends both.
    #[error(
        "a kill of the control group `{group}`, as at the end of a service or a container or when memory runs out, leaves the force of \
         `{device}` on: the watchdog process cannot leave that group, and the device has no watchdog of its own; `flotor doctor` says how \
         to start the program; `[limits] accept_shared_control_group = true` in a scene or `--accept-shared-control-group` accepts it"
    )]
    SharedControlGroup {
        /// Name of the device in the scene.
        device: String,
        /// The group of both processes.
        group: String,
    },
    /// The emergency stop of the machine is pressed, or was while the run started; nothing was energised.
    #[error("{}", latch::latched_words(.0.as_ref()))]
    Latched(Option<Pressed>),
    /// A call of the loop did not return; the devices are stopped.
    #[error("`{who}` did not return from {} in tick {}{limit}", stuck.place.call(), stuck.tick)]
    Hung {
        /// Name in the scene, or "device" or "host".
        who: String,
        /// Where it is.
        stuck: Stuck,
        /// The limit that the call has exceeded.
        limit: Exceeded,
    },
}

impl RunError {
    /// True if a request to stop came before the run.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        matches!(self, Self::Calls(CallError::Stopped) | Self::Lookup(LookupError::Calls(CallError::Stopped)))
    }

    /// True if the scene or the command line is wrong, not a plugin.
    #[must_use]
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Scene(_)
            | Self::Mismatch { .. }
            | Self::SharedControlGroup { .. }
            | Self::Lookup(LookupError::Unknown { .. } | LookupError::Ambiguous { .. }) => true,
            Self::Lookup(LookupError::Refused(error)) | Self::Plugin(error) => error.is_configuration(),
            Self::Thread(_)
            | Self::NoThread(_)
            | Self::Hung { .. }
            | Self::WatchdogProcess(_)
            | Self::Calls(_)
            | Self::Latched(_)
            | Self::Lookup(LookupError::Calls(_)) => false,
        }
    }
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
    /// Where each parameter is usefully moved by hand; none for what is no number.
    pub soft_ranges: Vec<Option<SoftRange>>,
    /// Of a device: what it moves.
    pub embodiment: Option<Embodiment>,
    /// Latency that a device declares, s; 0 of a model.
    pub latency_s: f64,
    /// Of a device: the outputs of models that reach the hand there.
    pub felt: Demand,
    /// Of a model: where it runs, its origin looked at.
    pub isolation: Option<Isolation>,
    /// Signals of the host that it took away while it was made, and that were taken back.
    pub signals_taken: TakenSignals,
    /// What a model says of its own error when it is ready ([`crate::estimates`]), by name.
    pub estimates: Vec<(String, f64)>,
}

impl PluginReport {
    /// That it took signals of the host away, if it did.
    pub(crate) fn warning(&self) -> Option<String> {
        let Self { name, signals_taken, .. } = self;
        (!signals_taken.is_none()).then(|| {
            format!("`{name}` took {signals_taken} away from the host during its creation; the host has taken them back")
        })
    }
}

/// Looks at every tick, off the loop.
pub trait Observer {
    /// What a tick has left behind at one device: tick after tick, and within a tick device after device. Not real-time.
    fn observe(&mut self, record: &TickRecord);

    /// A parameter that changed, before the tick that saw it first. Not real-time.
    fn change(&mut self, _change: &Change) {}

    /// Returns the outputs of models that the observer reads; the loop computes the others only where the hand feels them.
    /// Called before the run and now and then during it. Not real-time.
    fn demand(&self) -> Demand {
        Demand::FORCE
    }
}

/// The newest record of a device, for another thread: version 0 is a device at home before the first tick. Read without waiting.
pub type Tap = flotor_sync::Observer<TickRecord, RECORD_WORDS>;

/// The loop's ends of the taps, each with the number of its device.
type TapEnds = Vec<(u16, flotor_sync::Publisher<TickRecord, RECORD_WORDS>)>;

/// Makes a record the newest of its device. Real-time: bounded, no allocation.
#[inline]
fn publish_to(taps: &mut TapEnds, record: &TickRecord) {
    taps.iter_mut().filter(|(device, _)| *device == record.device).for_each(|(_, tap)| tap.publish(record));
}

/// A device before the first tick.
const AT_HOME: TickRecord = TickRecord {
    tick: 0,
    device: 0,
    time_ns: 0,
    dt_ns: 0,
    pose: Pose::HOME,
    twist: Twist::ZERO,
    model: ModelOutputs::ZERO,
    commanded: Wrench::ZERO,
    delivered: Wrench::ZERO,
    port_energy_j: 0.0,
    events: flotor_core::trace::Events::NONE,
    buttons: 0,
    lateness_ns: 0,
    compute_ns: 0,
};

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
    strength: Strength,
    strong_devices: Vec<StrongDevice>,
    /// Of the devices, in order, as scene and device allow: without the host's ceiling.
    strong_envelopes: Vec<Envelope>,
    norm_notice: Option<String>,
    boundary_notices: Vec<String>,
    warnings: Vec<String>,
    /// Stops what has a means of its own to be stopped, if this process is gone (real clock only).
    watchdog_process: Option<WatchdogProcess>,
    /// The run ends without that.
    requires_independent_stop: bool,
    /// None on the virtual clock, where no hand is held.
    latch: Option<LatchGuard>,
    taps: TapEnds,
    capabilities: Vec<Capabilities>,
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
    /// Time of the emergency stop, if there was one (real clock only).
    pub stop_time: Option<StopTime>,
    /// What the devices say at the end, in the scene's order.
    pub devices: Vec<DeviceOutcome>,
    /// What has become of each coupling, in the scene's order.
    pub couplings: Vec<CouplingOutcome>,
    /// Name, health and last words of each model the run began with.
    pub models: Vec<(String, ModelHealth, String)>,
    /// Of the plugins that took the place of a model later, those that did not behave.
    pub misbehaved: Vec<Misbehaved>,
    /// The plugins in place of models after a hot swap, at the end; not those that the seed chose among several.
    pub replacements: Vec<PluginReport>,
    /// What people should know, a sentence each: first what was known before the run.
    pub warnings: Vec<String>,
    /// How many of them were told then, or at once.
    known_before: usize,
    /// The first plugin that did not return from a call right after the run.
    pub unresponsive: Option<Unresponsive>,
    /// The plugins themselves. To be freed or dropped after all that depends on no plugin: their code may hang.
    pub remains: Remains,
}

impl Outcome {
    /// The warnings that came up in the run.
    #[must_use]
    pub fn later_warnings(&self) -> &[String] {
        self.warnings.get(self.known_before..).unwrap_or_default()
    }
    /// What is known of a run whose loop did not come back: how it ended, and for how long it was observed.
    #[must_use]
    pub fn of_hung_loop(stuck: Stuck, elapsed_ns: u64) -> Self {
        Self {
            end: RunEnd::Watchdog(stuck),
            timing: Timing { ticks: stuck.tick, ..Timing::default() },
            elapsed_ns,
            wall_s: elapsed_ns as f64 * 1.0e-9,
            dropped_records: 0,
            real_time: RealTimeReport::not_asked(),
            stop_time: None,
            devices: Vec::new(),
            couplings: Vec::new(),
            models: Vec::new(),
            misbehaved: Vec::new(),
            replacements: Vec::new(),
            warnings: Vec::new(),
            known_before: 0,
            unresponsive: None,
            remains: Remains::default(),
        }
    }

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
    /// The first fault, of the device itself or found by the host.
    pub fault: Option<Fault>,
    /// Its samples that cannot be.
    pub implausible: ImplausibleSamples,
    /// Effects of the envelope's passivity controller and slew limit.
    pub effects: EnvelopeEffects,
    /// What the host has found of its samples, or of how it takes commands.
    pub problem: Option<String>,
    /// Its own energy balance, where it keeps one.
    pub ledger: Option<EnergyLedger>,
    /// Its last message, or what the host found wrong with it; empty if there is neither.
    pub words: String,
    /// Calls that left the floating-point environment of the loop's thread changed; it was put back each time.
    pub float_changes: u64,
}

/// Records that fit between loop and observers: four seconds at 1 kHz.
const RING_RECORDS: usize = 4096;
/// How long a watchdog that is not needed any more may take to end.
const WATCHDOG_END: Duration = Duration::from_millis(50);
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
        let latch = (options.clock == Clock::Real).then(LatchGuard::of_this_user);

        let mut plugins = Vec::new();
        let mut opened = Vec::new();
        for device in &scene.devices {
            let (device, mut report) = prepare::open_device(registry, device)?;
            let most_torque_nm = Bound::box_of(device.capabilities.max_torque_nm);
            report.felt = felt_within(&scene.limits.torque_nm.and(most_torque_nm));
            opened.push(device);
            plugins.push(report);
        }
        let mut scene = scene.clone();
        let simulated: Vec<bool> =
            opened.iter().map(|device| device.embodiment == Embodiment::Simulated).collect();
        for model in &mut scene.models {
            prepare::settle_isolation(model, options.clock, &simulated);
            let device = opened.get(usize::from(model.device));
            model.latency_s = device.map_or(0.0, |device| device.capabilities.latency_s);
        }
        let scene = &scene;
        let mut models = Vec::new();
        for model in &scene.models {
            let (layer, report) = prepare_model(registry, model, &config, options.clock)?;
            models.push((usize::from(model.device), layer));
            plugins.push(report);
        }
        for (number, (device, opened)) in (0..).zip(scene.devices.iter().zip(&opened)) {
            let mut mismatches = prepare::pair(scene, number, &opened.capabilities, opened.device.can_pace());
            mismatches.extend(opened.stop.missing().filter(|_| scene.limits.require_independent_stop));
            if !mismatches.is_empty() {
                return Err(RunError::Mismatch { device: device.plugin.plugin.clone(), mismatches });
            }
        }
        let mut warnings: Vec<String> = plugins.iter().filter_map(PluginReport::warning).collect();
        let torqueless = (0..)
            .zip(&opened)
            .filter_map(|(number, opened)| prepare::without_torque(scene, number, &opened.capabilities));
        warnings.extend(torqueless);
        warnings.extend(prepare::amplifications(scene));
        warnings.extend(latch.as_ref().and_then(LatchGuard::warning));
        let WatchdogStart { process: watchdog_process, warnings: stops_missing } = match options.clock {
            Clock::Real => {
                let stops: Vec<_> = opened.iter().map(|opened| &opened.stop).collect();
                start_watchdog_process(&stops, &scene.limits)?
            }
            Clock::Virtual => WatchdogStart::default(),
        };
        warnings.extend(stops_missing);
        let table = PluginTable::new(&plugins);
        let Scheduled { changes, replacements } =
            prepare::schedule(scene, &table, registry, &config, options.clock)?;
        let room = models.len() + replacements.len();
        let (parameters, sender, reports) = ParameterQueue::new(changes, room);
        let (swaps, host_swaps) = swap_queues(models.len(), replacements);
        let controls =
            Controls::new(table.clone(), sender, &scene.models, (config, options.clock), host_swaps);

        let capabilities: Vec<_> = opened.iter().map(|opened| opened.capabilities).collect();
        let guard = |limits: &Limits, device: &Capabilities| {
            Envelope::new(limits, &scene.boundary, device, period_ns)
        };
        let strong_envelopes = capabilities.iter().map(|device| guard(&scene.limits, device)).collect();
        let strong_devices = scene.devices.iter().zip(&opened).filter_map(|(device, opened)| {
            let names = [device.name.as_str(), device.plugin.plugin.as_str()];
            StrongDevice::of(names, opened.embodiment, &scene.limits, &opened.capabilities)
        });
        let strong_devices = strong_devices.collect();
        let boundary_notices =
            scene.devices.iter().zip(&capabilities).filter_map(|(device, capabilities)| {
                let wall =
                    RenderedBoundary::new(&scene.boundary, capabilities, &scene.limits.force_n, period_ns);
                let is_driven = capabilities.actuated != Axes::NONE;
                wall.notice().filter(|_| is_driven).map(|notice| format!("`{}`: {notice}", device.name))
            });
        let boundary_notices = boundary_notices.collect();
        let devices = opened.into_iter().map(|opened| {
            let limits = under_ceiling(&scene.limits, opened.embodiment);
            let envelope = guard(&limits, &opened.capabilities);
            Guarded { device: opened.device, capabilities: opened.capabilities, envelope }
        });
        let devices: Vec<_> = devices.collect();
        let period_s = period_ns as f64 * 1.0e-9;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a minute
        let [ramp_ns, watchdog_ns] =
            [scene.limits.ramp_s, scene.limits.watchdog_s].map(|seconds| (seconds * 1.0e9).round() as u64);
        // A partner on another host is watched like the loop itself.
        let patience = Patience { silence_ns: watchdog_ns, fade_ns: ramp_ns };
        let mut lines = Vec::new();
        let couplings = scene.couplings.iter().map(|coupling| {
            let here = coupling.ends.here().first().and_then(|end| capabilities.get(usize::from(end.device)));
            let reach = here.map(|device| Reach { range_m: device.range_m, range_rad: device.range_rad });
            let reach = reach.unwrap_or_default();
            let (coupled, line) = Coupled::new(coupling, period_s, patience, reach);
            lines.extend(line.map(|line| (coupling.name.clone(), line)));
            coupled
        });
        let forces = Forces::new(devices.len(), models, couplings.collect());
        let emergency_buttons = scene.limits.emergency_buttons;
        let run = RunConfig { period_ns, ramp_ns, longest_gap_ns: watchdog_ns, emergency_buttons };
        Ok(Self {
            standby: Standby::new(devices, forces, parameters, swaps, config, run),
            controls,
            changes: ChangeLog::new(table, reports),
            clock: options.clock,
            pacing: scene.pacing,
            period_ns,
            duration_ns,
            watchdog_ns,
            core: None,
            plugins,
            lines,
            strength: Strength::UnderCeiling,
            strong_devices,
            strong_envelopes,
            norm_notice: norm_notice(&scene.limits, &capabilities),
            boundary_notices,
            warnings,
            watchdog_process,
            requires_independent_stop: scene.limits.require_independent_stop,
            latch,
            taps: Vec::new(),
            capabilities,
        }
        .with_strength(Strength::of_the_environment()))
    }

    /// The same without the host's ceiling: the devices are as strong as they and the scene allow. Only a person who knows
    /// the device should say so; a scene cannot. Not real-time.
    #[must_use]
    pub fn allow_strong(mut self) -> Self {
        self.standby.guard_with(std::mem::take(&mut self.strong_envelopes));
        self.strength = Strength::Strong;
        self
    }

    /// [`Session::allow_strong`], if this is strong; otherwise the same. Not real-time.
    #[must_use]
    pub fn with_strength(self, strength: Strength) -> Self {
        match (strength, self.strength) {
            (Strength::Strong, Strength::UnderCeiling) => self.allow_strong(),
            _ => self,
        }
    }

    /// The devices that would get more without the host's ceiling, in the scene's order; none once that is
    /// [lifted](Self::allow_strong).
    #[must_use]
    pub fn held_back(&self) -> &[StrongDevice] {
        match self.strength {
            Strength::UnderCeiling => &self.strong_devices,
            Strength::Strong => &[],
        }
    }

    /// What a person should know of the limits before the run, a line each. Not real-time.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        let strong = self.strong_devices.iter().map(|device| device.notice(self.strength));
        self.norm_notice.iter().chain(&self.boundary_notices).cloned().chain(strong).collect()
    }

    /// What people should know before this runs, a sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The same with the loop on this core, on the real clock.
    #[must_use]
    pub fn on_core(self, core: Option<Core>) -> Self {
        Self { core, ..self }
    }

    /// The same with the latch of another folder than that of this user's runs, from now on.
    #[must_use]
    pub fn latched_in(self, directory: &Directory) -> Self {
        Self { latch: self.latch.as_ref().map(|_| LatchGuard::of(directory)), ..self }
    }

    /// The latch that stops this run and that it presses; none on the virtual clock, where no hand is held.
    #[must_use]
    pub fn latch(&self) -> Option<&LatchGuard> {
        self.latch.as_ref()
    }

    /// The loop itself, its devices energised, for whoever paces it differently; the stoppers must be used before it is
    /// dropped. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device says no, [`RunError::Latched`]; then none is energised.
    pub fn into_loop(self) -> Result<(Servo, Vec<Stopper>), RunError> {
        self.latch().map_or(Ok(()), LatchGuard::check)?;
        let stoppers = self.standby.stoppers();
        Ok((activate(self.standby, &self.plugins)?, stoppers))
    }

    /// The core the loop is to run on, if one is named.
    pub fn core(&self) -> Option<Core> {
        self.core
    }

    /// Nominal time between ticks, ns.
    pub fn period_ns(&self) -> u64 {
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
        let finite = |limit: f64| limit.is_finite().then_some(limit);
        let most = self.standby.most();
        let [force_n, torque_nm] = most.map(|bound| bound.axes().map(finite));
        let [force_norm_n, torque_norm_nm] = most.map(|bound| finite(bound.norm()));
        WrenchLimits { force_n, torque_nm, force_norm_n, torque_norm_nm }
    }

    /// The couplings whose other end is on another host, by name, each with the line for its peer state.
    /// Given once; an end whose line nobody takes is never heard of, and asks for nothing.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// The newest record of a device, as soon as its tick is over: for a program that runs along with the loop. Not real-time.
    #[must_use]
    pub fn tap(&mut self, device: u16) -> Tap {
        let (end, tap) = flotor_sync::latest(TickRecord { device, ..AT_HOME });
        self.taps.push((device, end));
        tap
    }

    /// Returns the place where observers ask for outputs of the models, beside the one that the run is given.
    #[must_use]
    pub fn observers(&self) -> ObserverDemand {
        self.standby.observers()
    }

    /// What the devices can do, in the scene's order.
    #[must_use]
    pub fn capabilities(&self) -> &[Capabilities] {
        &self.capabilities
    }

    /// The handle by which other threads change parameters of the run.
    #[must_use]
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Runs until the duration is over, somebody uses `stop`, or the device faults.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device refuses to be energised, [`RunError::NoThread`] if the system has no thread for a part of the run,
    /// [`RunError::Hung`] if it does not come back: it is left behind then, and the process should end soon;
    /// [`RunError::Latched`] if the emergency stop of the machine is pressed, on the real clock.
    pub fn run(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Outcome, RunError> {
        let reserve = EndReserve::take().map_err(|_| RunError::NoThread("the end of the run"))?;
        let epilogue = self.epilogue(reserve);
        let finished = match self.clock {
            Clock::Virtual => self.run_virtual(observer, stop)?,
            Clock::Real => self.run_real(observer, stop)?,
        };
        Ok(epilogue.conclude(finished))
    }

    /// What the end of this run needs to know of its beginning.
    fn epilogue(&self, reserve: EndReserve) -> Epilogue {
        Epilogue {
            reserve,
            started: Instant::now(),
            warnings: self.warnings.clone(),
            heart: self.standby.heart(),
            names: self.plugins.iter().map(|plugin| plugin.name.clone()).collect(),
            controls: self.controls.clone(),
        }
    }

    /// The loop on a thread of its own; this one lets the observers look.
    fn run_real(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Finished, RunError> {
        let (mut sender, mut receiver) = queue(RING_RECORDS);
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
            watchdog_process,
            requires_independent_stop,
            latch,
            mut taps,
            ..
        } = self;
        let watchdog_process = watchdog_process.map(Arc::new);
        let mut guardian = Guardian::of(watchdog_process.as_ref(), requires_independent_stop);
        // Before the look at the latch that counts: a press after that is seen here.
        let watch = latch.as_ref().map(|latch| latch.watch(stop)).transpose();
        let _watch = watch.map_err(|_| RunError::NoThread(latch::WATCH))?;
        let mut asked = standby.observers().request(observer.demand());
        let mut look = |observer: &mut dyn Observer, record: TickRecord| {
            changes.up_to(record.tick, |change| observer.change(change));
            observer.observe(&record);
        };
        let heart = standby.heart();
        let loop_stop = stop.clone();
        // Not scoped: a thread that is stuck in a plugin has to be left behind.
        let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
        let (loop_heart, loop_plugins, loop_latch) = (heart.clone(), plugins.clone(), latch.clone());
        let (progress, all_stoppers) = (Progress::default(), standby.stoppers());
        let loop_progress = progress.clone();
        // Number of the device that is being stopped, from 1: looked at from here, as `safe_stop` may hang too.
        let stopping = Arc::new(AtomicUsize::new(0));
        let loop_stopping = Arc::clone(&stopping);
        let servo_thread = thread.spawn(move || {
            let real_time = enter_real_time(core);
            // That it is gone is noticed by who looks on.
            let signs = watchdog_process.as_ref().and_then(|process| {
                let _ = process.follow_this_thread();
                process.sign_of_life().ok()
            });
            let spin = match pacing {
                Pacing::Host => Some(SpinWindow::measure(period_ns)),
                Pacing::Device => None,
            };
            // Last of all that takes time.
            let stoppers = standby.stoppers();
            loop_latch.as_ref().map_or(Ok(()), LatchGuard::check)?;
            let servo = activate_here(standby, &loop_plugins, &loop_progress)?;
            let schedule = match spin {
                Some(window) => Schedule::start_real(period_ns, window),
                None => Schedule::start_paced(period_ns),
            };
            let watchdog =
                start_watchdog(loop_heart, stoppers.clone(), loop_stop.clone(), watchdog_ns, signs);
            let mut runner = Loop::new(servo, schedule, duration_ns).releasing();
            // Without a watchdog nothing is moved.
            // A full queue drops records and counts them: observers never delay the loop.
            let (mut dropped_records, mut tick_ns) = (0, 0);
            while watchdog.is_ok() && runner.end().is_none() {
                runner.advance(&loop_stop, |record| {
                    publish_to(&mut taps, record);
                    tick_ns = record.compute_ns;
                    dropped_records += u64::from(sender.push(*record).is_err())
                });
            }
            let mut timer = StopTimer::start(Duration::from_nanos(tick_ns));
            // A button, or the device itself: for the latch, whatever becomes of `safe_stop`.
            if let Some(RunEnd::EmergencyStop(source)) = runner.end() {
                loop_stop.press(source);
            }
            // Here, whatever the thread that looks on is at, and while the watchdog still watches.
            for (number, stopper) in (1..).zip(&stoppers) {
                loop_stopping.store(number, Ordering::Relaxed);
                stopper.safe_stop();
                timer.stopped();
            }
            loop_stopping.store(0, Ordering::Relaxed);
            runner.servo().heart().finish();
            // From here on nothing is energised.
            drop(watchdog_process);
            if let Ok(watchdog) = &watchdog {
                wait_for_end_of(watchdog);
            }
            watchdog.map_err(|_| RunError::NoThread("the watchdog"))?;
            let finished = Finished::of(runner, dropped_records, real_time);
            let is_emergency = matches!(finished.end, RunEnd::EmergencyStop(_));
            let stop_time = is_emergency.then(|| timer.since_request(&loop_stop, loop_latch.as_ref()));
            Ok::<_, RunError>(Finished { stop_time, ..finished })
        });
        let servo_thread = servo_thread.map_err(|_| RunError::NoThread("the loop"))?;
        let mut bitten = None;
        let mut stopping_since = None;
        while !servo_thread.is_finished() {
            asked.change_to(observer.demand());
            drain(&mut receiver, |record| look(observer, record));
            controls.sweep();
            guardian.look(stop);
            if let Err(hung) = progress.look(limit()) {
                // Others may be energised by now.
                all_stoppers.iter().for_each(Stopper::safe_stop);
                return Err(CallError::from(hung).into());
            }
            stopping_since = match stopping.load(Ordering::Relaxed) {
                0 => None,
                number => Some(stopping_since.unwrap_or((number, Instant::now()))),
            };
            if let Some((number, since)) = stopping_since
                && since.elapsed() > end_limit()
            {
                leave_behind();
                let who = plugins.get(number - 1).map_or_else(String::new, |plugin| plugin.name.clone());
                let hung = Unresponsive { who, call: Call::SafeStop, limit: end_limit() };
                return Err(CallError::from(hung).into());
            }
            bitten = bitten.or_else(|| heart.bitten().map(|stuck| (stuck, Instant::now())));
            if let Some((stuck, since)) = bitten
                && since.elapsed() > COME_BACK
            {
                leave_behind();
                return Err(hung(stuck, &plugins, Exceeded::Watchdog(Duration::from_nanos(watchdog_ns))));
            }
            std::thread::sleep(OBSERVER_PERIOD);
        }
        let finished = servo_thread.join().map_err(|_| RunError::Thread("panicked"))??;
        drain(&mut receiver, |record| look(observer, record));
        Ok(Finished { end: guardian.end(finished.end), warning: guardian.warning(), ..finished })
    }
}

/// Waits until the watchdog, which looks every millisecond, no longer holds the devices: they are closed where a hang is named.
/// Not for longer: it may be in a `safe_stop` that hangs.
fn wait_for_end_of(watchdog: &JoinHandle<()>) {
    let since = Instant::now();
    while !watchdog.is_finished() && since.elapsed() < WATCHDOG_END {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whose fault a stuck loop is, by name.
fn hung(stuck: Stuck, plugins: &[PluginReport], limit: Exceeded) -> RunError {
    let name = |index: usize| plugins.get(index).map_or_else(String::new, |plugin| plugin.name.clone());
    let devices = plugins.iter().filter(|plugin| plugin.metadata.kind == PluginKind::Device).count();
    let who = match stuck.place {
        Place::Model(index) => name(devices + index),
        Place::DeviceWait(device) | Place::DeviceRead(device) | Place::DeviceWrite(device) => {
            name(device.into())
        }
        Place::Host | Place::Waiting => "host".to_owned(),
    };
    RunError::Hung { who, stuck, limit }
}

struct Finished {
    servo: Servo,
    end: RunEnd,
    elapsed_ns: u64,
    dropped_records: u64,
    real_time: RealTimeReport,
    /// Of an emergency stop on the real clock.
    stop_time: Option<StopTime>,
    /// What people should know, and were told.
    warning: Option<String>,
}

impl Finished {
    fn of(ended: Loop, dropped_records: u64, real_time: RealTimeReport) -> Self {
        let (servo, end, elapsed_ns) = ended.finish();
        Self { servo, end, elapsed_ns, dropped_records, real_time, stop_time: None, warning: None }
    }
}
