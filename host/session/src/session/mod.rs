//! Session: loads the plugins of a scene, pairs them, runs the loop, and gives observers and controls access.

mod ceiling;
mod choice;
mod controls;
mod epilogue;
mod latch;
mod lockstep;
mod prepare;
mod steps;
mod stop_time;
mod stop_without_host;
mod unfreed_plugins;
mod unguarded;
mod virtual_loop;

pub use ceiling::{Strength, StrongDevice};
pub use controls::{ControlError, Controls, FaultyPlugin, NewValue};
pub use latch::{LatchGuard, LatchWatch, StopReach};
pub use lockstep::Lockstep;
pub use prepare::{check_plugins, prepare_model};
pub use steps::Steps;
pub use stop_time::StopTime;
pub use stop_without_host::{StopWithoutHost, WatchdogStart, start_watchdog_process};
pub use unfreed_plugins::UnfreedPlugins;
pub use unguarded::Guardian;

use crate::calls::{Call, CallError, EndReserve, Progress, Unresponsive, abandon, end_limit, limit};
use crate::long_call::Exceeded;
use crate::registry::{LookupError, Registry};
use crate::scene::{Isolation, Pacing, Scene, SceneError};
use ceiling::{norm_notice, under_ceiling};
use controls::{ChangeLog, PluginTable};
use epilogue::Epilogue;
use flotor_core::Change;
use flotor_core::ModelOutputs;
use flotor_core::demand::{ObserverDemand, hand_demand};
use flotor_core::limits::{Bound, Limits};
use flotor_core::plausibility::ImplausibleSamples;
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_coupling::{Line, LinkTimeouts, Reach};
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

/// Options of a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Real or virtual clock.
    pub clock: Clock,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Reason why a run did not start, or failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene is not valid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A plugin is unknown or was rejected.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// A plugin refused its settings or a call.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// Device and scene do not fit; all mismatches at once.
    #[error("the scene does not fit the device `{device}`: {}", mismatches.join("; "))]
    Mismatch {
        /// Id of the device.
        device: String,
        /// Mismatches, each with a remedy.
        mismatches: Vec<String>,
    },
    /// A plugin did not return from a call before the run.
    #[error(transparent)]
    Calls(#[from] CallError),
    /// The servo thread failed.
    #[error("the servo thread {0}; no device was moved")]
    Thread(&'static str),
    /// The system has no thread for this part of the run.
    #[error("cannot start the thread for {0}, so no device was moved; {THREAD_ADVICE}")]
    NoThread(&'static str),
    /// The scene requires a stop that does not depend on this process, and there is none.
    #[error(
        "cannot start the watchdog process: {0}; `[limits] require_independent_stop = true` requires this process; \
         correct the cause, or remove that line"
    )]
    WatchdogProcess(std::io::Error),
    /// Only the watchdog process stops a device when this process is gone, and a kill of one control group ends both.
    #[error(
        "a kill of the control group `{group}`, as at the end of a service or a container or when memory runs out, leaves the force of \
         `{device}` on: the watchdog process cannot leave that group, and the device has no watchdog of its own; \
         `flotor doctor` describes how to start the program; `[limits] accept_shared_control_group = true` in a \
         scene or `--accept-shared-control-group` accepts it"
    )]
    SharedControlGroup {
        /// Name of the device in the scene.
        device: String,
        /// Control group of both processes.
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
        /// Tick and place of the call.
        stuck: Stuck,
        /// The limit that the call has exceeded.
        limit: Exceeded,
    },
}

impl RunError {
    /// Returns true if a stop was requested before the run.
    #[must_use]
    pub const fn is_stopped(&self) -> bool {
        matches!(self, Self::Calls(CallError::Stopped) | Self::Lookup(LookupError::Calls(CallError::Stopped)))
    }

    /// Returns true if the scene or the command line is wrong, not a plugin.
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
    /// Metadata of the plugin.
    pub metadata: Metadata,
    /// Parameters of the plugin.
    pub schema: &'static [Parameter],
    /// Settings of scene and command line, as written, in order.
    pub settings: Vec<(String, String)>,
    /// Every parameter with its value before the run, as text.
    pub parameters: Vec<(String, String)>,
    /// Range of each parameter for changes by hand; `None` for a parameter that is no number.
    pub soft_ranges: Vec<Option<SoftRange>>,
    /// Embodiment of a device; `None` for a model.
    pub embodiment: Option<Embodiment>,
    /// Latency that a device declares, s; 0 for a model.
    pub latency_s: f64,
    /// Model outputs that reach the hand at a device.
    pub at_hand: Demand,
    /// Isolation of a model, resolved by its origin; `None` for a device.
    pub isolation: Option<Isolation>,
    /// Signals of the host that the plugin took during its creation, restored since.
    pub signals_taken: TakenSignals,
    /// Error estimates of a model ([`crate::estimates`]), by name.
    pub estimates: Vec<(String, f64)>,
}

impl PluginReport {
    /// Returns a warning if the plugin took signals of the host.
    pub(crate) fn warning(&self) -> Option<String> {
        let Self { name, signals_taken, .. } = self;
        (!signals_taken.is_none()).then(|| {
            format!("`{name}` replaced {signals_taken} of the host during its creation; the host has restored them")
        })
    }
}

/// Observer of every tick, off the loop.
pub trait Observer {
    /// Receives the record of a tick at one device: tick after tick, and within a tick device after device. Not real-time.
    fn observe(&mut self, record: &TickRecord);

    /// Receives a change of a parameter, before the first tick with the new value. Not real-time.
    fn change(&mut self, _change: &Change) {}

    /// Returns the model outputs that the observer reads; the loop computes the others only where the hand feels them. Called
    /// before the run and repeatedly during the run. Not real-time.
    fn demand(&self) -> Demand {
        Demand::FORCE
    }
}

/// The newest record of a device, for another thread: version 0 is a device at home before the first tick. Read without waiting.
pub type Tap = flotor_sync::Observer<TickRecord, RECORD_WORDS>;

/// Loop sides of the taps, each with its device number.
type TapEnds = Vec<(u16, flotor_sync::Publisher<TickRecord, RECORD_WORDS>)>;

/// Publishes a record as the newest of its device. Real-time: bounded, no allocation.
#[inline]
fn publish_to(taps: &mut TapEnds, record: &TickRecord) {
    taps.iter_mut().filter(|(device, _)| *device == record.device).for_each(|(_, tap)| tap.publish(record));
}

/// Initial record: device at home.
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
    /// Envelopes of the devices, in order, without the host's ceiling.
    strong_envelopes: Vec<Envelope>,
    norm_notice: Option<String>,
    boundary_notices: Vec<String>,
    warnings: Vec<String>,
    /// Process that stops the devices if this process ends (real clock only).
    watchdog_process: Option<WatchdogProcess>,
    /// True if the run has to end without the watchdog process.
    requires_independent_stop: bool,
    /// `None` on the virtual clock, where no hand is held.
    latch: Option<LatchGuard>,
    taps: TapEnds,
    capabilities: Vec<Capabilities>,
}

/// Outcome of a run.
pub struct Outcome {
    /// End of the run.
    pub end: RunEnd,
    /// Timing statistics of the loop.
    pub timing: Timing,
    /// Time from the first deadline to the end of the last period, ns (virtual clock: virtual time).
    pub elapsed_ns: u64,
    /// Wall-clock time, s.
    pub wall_s: f64,
    /// Ticks whose records were dropped because an observer was too slow (real clock only).
    pub dropped_records: u64,
    /// Privileges that the system granted.
    pub real_time: RealTimeReport,
    /// Duration of the emergency stop, if there was one (real clock only).
    pub stop_time: Option<StopTime>,
    /// Outcomes of the devices, in the scene's order.
    pub devices: Vec<DeviceOutcome>,
    /// Statistics of the couplings, in the scene's order.
    pub couplings: Vec<CouplingOutcome>,
    /// Name, health and last message of each model that the run began with.
    pub models: Vec<(String, ModelHealth, String)>,
    /// Replacements with faults.
    pub faulty_plugins: Vec<FaultyPlugin>,
    /// Replacements in place at the end, after a hot swap; not those that the seed chose among several.
    pub replacements: Vec<PluginReport>,
    /// Warnings for users, a sentence each: first those known before the run.
    pub warnings: Vec<String>,
    /// Number of warnings that were shown before the run or at once.
    known_before: usize,
    /// The first plugin that did not return from a call right after the run.
    pub unresponsive: Option<Unresponsive>,
    /// Plugin instances left to free. Free or drop them last: plugin code may hang.
    pub unfreed_plugins: UnfreedPlugins,
}

impl Outcome {
    /// Returns the warnings that came up in the run.
    #[must_use]
    pub fn later_warnings(&self) -> &[String] {
        self.warnings.get(self.known_before..).unwrap_or_default()
    }
    /// Returns the outcome of a run whose loop did not return, from the stuck place and the time observed, ns.
    #[must_use]
    pub fn of_hung_loop(stuck: Stuck, elapsed_ns: u64) -> Self {
        Self {
            end: RunEnd::Watchdog(stuck),
            timing: Timing { ticks: stuck.tick, ..Timing::default() },
            elapsed_ns,
            wall_s: elapsed_ns as f64 * 1.0e-9,
            dropped_records: 0,
            real_time: RealTimeReport::not_requested(),
            stop_time: None,
            devices: Vec::new(),
            couplings: Vec::new(),
            models: Vec::new(),
            faulty_plugins: Vec::new(),
            replacements: Vec::new(),
            warnings: Vec::new(),
            known_before: 0,
            unresponsive: None,
            unfreed_plugins: UnfreedPlugins::default(),
        }
    }

    /// Returns the number of the faulted device and its last message.
    #[must_use]
    pub fn faulted(&self) -> Option<(usize, &str)> {
        let mut devices = self.devices.iter().enumerate();
        let (number, device) = devices.find(|(_, device)| device.fault.is_some())?;
        Some((number, device.words.as_str()))
    }
}

/// Outcome of a device after a run.
#[derive(Clone, Debug)]
pub struct DeviceOutcome {
    /// First fault, reported by the device or found by the host.
    pub fault: Option<Fault>,
    /// Implausible samples of the device.
    pub implausible: ImplausibleSamples,
    /// Effects of the envelope's passivity controller and slew limit.
    pub effects: EnvelopeEffects,
    /// Problem with samples or commands of the device, found by the host.
    pub problem: Option<String>,
    /// Energy balance of the device itself, if it keeps one.
    pub ledger: Option<EnergyLedger>,
    /// Last message of the device, or the problem that the host found; empty without either.
    pub words: String,
    /// Calls that changed the floating-point environment of the loop's thread; the host restored it each time.
    pub float_changes: u64,
}

/// Capacity for records between loop and observers: four seconds at 1 kHz.
const RING_RECORDS: usize = 4096;
/// Timeout for the end of a watchdog that is not needed any more.
const WATCHDOG_END: Duration = Duration::from_millis(50);
/// Poll interval of the observers in real time.
const OBSERVER_PERIOD: Duration = Duration::from_millis(5);
/// Grace period for a stuck loop after the watchdog has stopped its device: a tick that was only late ends by itself, and its
/// report is complete.
const COME_BACK: Duration = Duration::from_millis(500);

impl Session {
    /// Loads, checks and opens the plugins of a scene, and energises none. Not real-time.
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
            report.at_hand = hand_demand(&scene.limits.torque_nm.and(most_torque_nm));
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
        // A partner on another host is monitored like the loop itself.
        let timeouts = LinkTimeouts { silence_ns: watchdog_ns, fade_ns: ramp_ns };
        let mut lines = Vec::new();
        let couplings = scene.couplings.iter().map(|coupling| {
            let here = coupling.ends.here().first().and_then(|end| capabilities.get(usize::from(end.device)));
            let reach = here.map(|device| Reach { range_m: device.range_m, range_rad: device.range_rad });
            let reach = reach.unwrap_or_default();
            let (coupled, line) = Coupled::new(coupling, period_s, timeouts, reach);
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

    /// Lifts the host's ceiling: the devices are as strong as they and the scene allow. Only a user who knows the device should
    /// decide so; a scene cannot. Not real-time.
    #[must_use]
    pub fn allow_strong(mut self) -> Self {
        self.standby.guard_with(std::mem::take(&mut self.strong_envelopes));
        self.strength = Strength::Strong;
        self
    }

    /// Applies [`Session::allow_strong`] if the strength is [`Strength::Strong`]. Not real-time.
    #[must_use]
    pub fn with_strength(self, strength: Strength) -> Self {
        match (strength, self.strength) {
            (Strength::Strong, Strength::UnderCeiling) => self.allow_strong(),
            _ => self,
        }
    }

    /// Returns the devices that would get more without the host's ceiling, in the scene's order; none once the ceiling is
    /// [lifted](Self::allow_strong).
    #[must_use]
    pub fn held_back(&self) -> &[StrongDevice] {
        match self.strength {
            Strength::UnderCeiling => &self.strong_devices,
            Strength::Strong => &[],
        }
    }

    /// Returns notices about the limits, to be shown before the run, a line each. Not real-time.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        let strong = self.strong_devices.iter().map(|device| device.notice(self.strength));
        self.norm_notice.iter().chain(&self.boundary_notices).cloned().chain(strong).collect()
    }

    /// Returns the warnings collected during preparation, a sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Pins the loop to this core, on the real clock.
    #[must_use]
    pub fn on_core(self, core: Option<Core>) -> Self {
        Self { core, ..self }
    }

    /// Uses the latch of another folder than that of this user's runs, from now on.
    #[must_use]
    pub fn latched_in(self, directory: &Directory) -> Self {
        Self { latch: self.latch.as_ref().map(|_| LatchGuard::of(directory)), ..self }
    }

    /// Returns the latch that stops this run and that its emergency stop presses; `None` on the virtual clock, where no hand is held.
    #[must_use]
    pub fn latch(&self) -> Option<&LatchGuard> {
        self.latch.as_ref()
    }

    /// Returns the servo with its devices energised, for a caller that paces the loop differently; the stoppers must be used before
    /// the servo is dropped. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device refuses, [`RunError::Latched`]; then none is energised.
    pub fn into_loop(self) -> Result<(Servo, Vec<Stopper>), RunError> {
        self.latch().map_or(Ok(()), LatchGuard::check)?;
        let stoppers = self.standby.stoppers();
        Ok((activate(self.standby, &self.plugins)?, stoppers))
    }

    /// Returns the core for the loop, if one is named.
    pub fn core(&self) -> Option<Core> {
        self.core
    }

    /// Returns the nominal time between ticks, ns.
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Returns the plugins of this run with the values of all parameters.
    #[must_use]
    pub fn plugins(&self) -> &[PluginReport] {
        &self.plugins
    }

    /// Returns the largest wrench that may reach a hand at any device: the tighter limit of scene and device.
    #[must_use]
    pub fn limits(&self) -> WrenchLimits {
        let finite = |limit: f64| limit.is_finite().then_some(limit);
        let most = self.standby.most();
        let [force_n, torque_nm] = most.map(|bound| bound.axes().map(finite));
        let [force_norm_n, torque_norm_nm] = most.map(|bound| finite(bound.norm()));
        WrenchLimits { force_n, torque_nm, force_norm_n, torque_norm_nm }
    }

    /// Returns the couplings with a remote end, by name, each with the line for its peer state. Returned once; an end without a
    /// connected line gets no peer state and requests no force.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// Creates a tap for the newest record of a device, as soon as its tick is over: for a program that runs along. Not real-time.
    #[must_use]
    pub fn tap(&mut self, device: u16) -> Tap {
        let (end, tap) = flotor_sync::latest(TickRecord { device, ..AT_HOME });
        self.taps.push((device, end));
        tap
    }

    /// Returns the demand of further observers for model outputs, beside the observer of the run.
    #[must_use]
    pub fn observers(&self) -> ObserverDemand {
        self.standby.observers()
    }

    /// Returns the capabilities of the devices, in the scene's order.
    #[must_use]
    pub fn capabilities(&self) -> &[Capabilities] {
        &self.capabilities
    }

    /// Returns the handle with which other threads change the run.
    #[must_use]
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Runs until the duration is over, `stop` is used, or the device faults.
    ///
    /// # Errors
    /// [`RunError::Plugin`] if a device refuses to be energised, [`RunError::NoThread`] if the system has no thread for a part of
    /// the run, [`RunError::Hung`] if the loop does not return: its thread is abandoned then, and the process should end soon;
    pub fn run(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Outcome, RunError> {
        let reserve = EndReserve::take().map_err(|_| RunError::NoThread("the end of the run"))?;
        let epilogue = self.epilogue(reserve);
        let finished = match self.clock {
            Clock::Virtual => self.run_virtual(observer, stop)?,
            Clock::Real => self.run_real(observer, stop)?,
        };
        Ok(epilogue.conclude(finished))
    }

    /// Collects the data from the beginning of this run that its end needs.
    fn epilogue(&self, reserve: EndReserve) -> Epilogue {
        Epilogue {
            reserve,
            started: Instant::now(),
            warnings: self.warnings.clone(),
            heartbeat: self.standby.heartbeat(),
            names: self.plugins.iter().map(|plugin| plugin.name.clone()).collect(),
            controls: self.controls.clone(),
        }
    }

    /// Runs the loop on a thread of its own; this thread serves the observers.
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
        // Watch before the final check of the latch, so that no press is missed.
        let watch = latch.as_ref().map(|latch| latch.watch(stop)).transpose();
        let _watch = watch.map_err(|_| RunError::NoThread(latch::WATCH))?;
        let mut requested = standby.observers().request(observer.demand());
        let mut deliver = |observer: &mut dyn Observer, record: TickRecord| {
            changes.up_to(record.tick, |change| observer.change(change));
            observer.observe(&record);
        };
        let heartbeat = standby.heartbeat();
        let loop_stop = stop.clone();
        // Not scoped: a thread that is stuck in a plugin has to be abandoned.
        let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
        let (loop_heartbeat, loop_plugins, loop_latch) = (heartbeat.clone(), plugins.clone(), latch.clone());
        let (progress, all_stoppers) = (Progress::default(), standby.stoppers());
        let loop_progress = progress.clone();
        // Number of the device that is being stopped, from 1: polled from this thread, as `safe_stop` may hang, too.
        let stopping = Arc::new(AtomicUsize::new(0));
        let loop_stopping = Arc::clone(&stopping);
        let servo_thread = thread.spawn(move || {
            let real_time = enter_real_time(core);
            // The polling thread notices the end of the process.
            let signs = watchdog_process.as_ref().and_then(|process| {
                let _ = process.follow_this_thread();
                process.heartbeat_sender().ok()
            });
            let spin = match pacing {
                Pacing::Host => Some(SpinWindow::measure(period_ns)),
                Pacing::Device => None,
            };
            // Last step that takes time.
            let stoppers = standby.stoppers();
            loop_latch.as_ref().map_or(Ok(()), LatchGuard::check)?;
            let servo = activate_here(standby, &loop_plugins, &loop_progress)?;
            let schedule = match spin {
                Some(window) => Schedule::start_real(period_ns, window),
                None => Schedule::start_paced(period_ns),
            };
            let watchdog =
                start_watchdog(loop_heartbeat, stoppers.clone(), loop_stop.clone(), watchdog_ns, signs);
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
            // A button or the device itself: press for the latch, even if `safe_stop` hangs.
            if let Some(RunEnd::EmergencyStop(source)) = runner.end() {
                loop_stop.press(source);
            }
            // Stop here, on the loop's thread, while the watchdog is still running.
            for (number, stopper) in (1..).zip(&stoppers) {
                loop_stopping.store(number, Ordering::Relaxed);
                stopper.safe_stop();
                timer.stopped();
            }
            loop_stopping.store(0, Ordering::Relaxed);
            runner.servo().heartbeat().finish();
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
        let mut fired = None;
        let mut stopping_since = None;
        while !servo_thread.is_finished() {
            requested.change_to(observer.demand());
            drain(&mut receiver, |record| deliver(observer, record));
            controls.sweep();
            guardian.check(stop);
            if let Err(hung) = progress.check(limit()) {
                // Other devices may be energised by now.
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
                abandon();
                let who = plugins.get(number - 1).map_or_else(String::new, |plugin| plugin.name.clone());
                let hung = Unresponsive { who, call: Call::SafeStop, limit: end_limit() };
                return Err(CallError::from(hung).into());
            }
            fired = fired.or_else(|| heartbeat.fired_at().map(|stuck| (stuck, Instant::now())));
            if let Some((stuck, since)) = fired
                && since.elapsed() > COME_BACK
            {
                abandon();
                return Err(hung(stuck, &plugins, Exceeded::Watchdog(Duration::from_nanos(watchdog_ns))));
            }
            std::thread::sleep(OBSERVER_PERIOD);
        }
        let finished = servo_thread.join().map_err(|_| RunError::Thread("panicked"))??;
        drain(&mut receiver, |record| deliver(observer, record));
        Ok(Finished { end: guardian.end(finished.end), warning: guardian.warning(), ..finished })
    }
}

/// Waits until the watchdog, which polls every millisecond, has released the devices, so that they are closed where a hang is
/// reported. Has a timeout: the watchdog may be in a `safe_stop` that hangs.
fn wait_for_end_of(watchdog: &JoinHandle<()>) {
    let since = Instant::now();
    while !watchdog.is_finished() && since.elapsed() < WATCHDOG_END {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Builds `RunError::Hung`, naming the plugin that blocks the loop.
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
    /// `None` without an emergency stop on the real clock.
    stop_time: Option<StopTime>,
    /// Warning for users, which was shown already.
    warning: Option<String>,
}

impl Finished {
    fn of(ended: Loop, dropped_records: u64, real_time: RealTimeReport) -> Self {
        let (servo, end, elapsed_ns) = ended.finish();
        Self { servo, end, elapsed_ns, dropped_records, real_time, stop_time: None, warning: None }
    }
}
