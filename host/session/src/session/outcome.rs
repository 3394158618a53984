//! Outcome of a run, and the steps after its last tick: de-energises the devices and queries the last messages of the models.

use super::controls::Settled;
use super::plugin_report::PluginNames;
use super::{Controls, FaultyPlugin, PluginReport, StopTime, UnfreedPlugins};
use crate::calls::{Call, CallError, CallThread, EndReserve, Unresponsive};
use flotor_core::health::ModelHealth;
use flotor_core::plausibility::ImplausibleSamples;
use flotor_hal::{EnergyLedger, Fault};
use flotor_loader::{ActiveDevice, OpenedDevice};
use flotor_servo::{
    CouplingOutcome, Dismantled, EnvelopeEffects, Forces, Heartbeat, Layer, LayerReport, Loop,
    RealTimeReport, Reported, RunEnd, Servo, Stuck, Timing,
};
use std::time::Instant;

/// Outcome of a run: end, statistics, and faults of devices and models.
pub struct Outcome {
    /// Reason why the run ended.
    pub end: RunEnd,
    /// Timing statistics of the loop.
    pub timing: Timing,
    /// Time from the first deadline to the end of the last period, ns (virtual clock: virtual time).
    pub elapsed_ns: u64,
    /// Wall-clock time from the start of the run to its outcome, s.
    pub wall_s: f64,
    /// Number of records dropped because an observer was too slow (real clock only).
    pub dropped_records: u64,
    /// Real-time privileges that the system granted or refused.
    pub real_time: RealTimeReport,
    /// Duration of the emergency stop; `None` without an emergency stop, and on the virtual clock.
    pub stop_time: Option<StopTime>,
    /// Outcomes of the devices, in the scene's order.
    pub devices: Vec<DeviceOutcome>,
    /// Statistics of the couplings, in the scene's order.
    pub couplings: Vec<CouplingOutcome>,
    /// Name, health and last message of each model that the run began with.
    pub models: Vec<(String, ModelHealth, String)>,
    /// Replacements of models that had faults.
    pub faulty_plugins: Vec<FaultyPlugin>,
    /// Replacements in place at the end, after a hot swap, without the replacements that the seed chose among several.
    pub replacements: Vec<PluginReport>,
    /// Warnings for users, a sentence each; the warnings known before the run come first.
    pub warnings: Vec<String>,
    /// Number of warnings that have been shown already.
    known_before: usize,
    /// First plugin that did not return from a call after the run; `None` if all returned.
    pub unresponsive: Option<Unresponsive>,
    /// Plugin instances that are not freed yet. Free or drop this value last: plugin code may hang.
    pub unfreed_plugins: UnfreedPlugins,
}

impl Outcome {
    /// Returns the warnings that arose during the run and have not been shown.
    #[must_use]
    pub fn later_warnings(&self) -> &[String] {
        self.warnings.get(self.known_before..).unwrap_or_default()
    }
    /// Returns the outcome of a run whose loop is stuck at `stuck`, after `elapsed_ns` of observed run time.
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

    /// Returns number and last message of the first device with a fault; `None` without a fault.
    #[must_use]
    pub fn faulted(&self) -> Option<(usize, &str)> {
        let mut devices = self.devices.iter().enumerate();
        let (number, device) = devices.find(|(_, device)| device.fault.is_some())?;
        Some((number, device.words.as_str()))
    }
}

/// Outcome of one device of a run.
#[derive(Clone, Debug)]
pub struct DeviceOutcome {
    /// First fault, reported by the device or detected by the host; `None` without a fault.
    pub fault: Option<Fault>,
    /// Counts of implausible samples of the device, by reason.
    pub implausible: ImplausibleSamples,
    /// Effects of the envelope's passivity controller and slew limit.
    pub effects: EnvelopeEffects,
    /// Problem with samples or commands of the device that the host detected; `None` without a problem.
    pub problem: Option<String>,
    /// Energy balance computed by the device itself; `None` for a device without an energy balance.
    pub ledger: Option<EnergyLedger>,
    /// Problem that the host found, or else the last message of the device; may be empty.
    pub words: String,
    /// Number of calls that changed the floating-point environment of the loop's thread; the host restored it each time.
    pub float_changes: u64,
}

/// Loop that has ended, with its devices stopped.
pub(super) struct Finished {
    pub(super) servo: Servo,
    pub(super) end: RunEnd,
    pub(super) elapsed_ns: u64,
    pub(super) dropped_records: u64,
    pub(super) real_time: RealTimeReport,
    /// `None` without an emergency stop on the real clock.
    pub(super) stop_time: Option<StopTime>,
    /// Warning for users that was shown already.
    pub(super) warning: Option<String>,
}

impl Finished {
    pub(super) fn of(ended: Loop, dropped_records: u64, real_time: RealTimeReport) -> Self {
        let (servo, end, elapsed_ns) = ended.finish();
        Self { servo, end, elapsed_ns, dropped_records, real_time, stop_time: None, warning: None }
    }
}

/// Data from the start of a run that its end needs.
pub(super) struct Epilogue {
    pub(super) started: Instant,
    pub(super) warnings: Vec<String>,
    pub(super) heartbeat: Heartbeat,
    pub(super) names: PluginNames,
    pub(super) controls: Controls,
    pub(super) reserve: EndReserve,
}

impl Epilogue {
    /// De-energises the devices and returns the outcome of the run.
    pub(super) fn conclude(self, finished: Finished) -> Outcome {
        let Self { started, mut warnings, heartbeat, names, controls, reserve } = self;
        let mut calls = reserve.begin();
        let Finished { servo, end, elapsed_ns, dropped_records, real_time, stop_time, warning } = finished;
        warnings.extend(warning);
        let known_before = warnings.len();
        let Dismantled { devices, last_stop, forces, swaps, timing } = servo.dismantle();
        let mut unresponsive = None;
        let (mut outcomes, mut closing) = (Vec::new(), Vec::new());
        for (name, device) in names.all.iter().zip(devices) {
            let (outcome, opened) = deactivate(&mut calls, name, device, &mut unresponsive);
            outcomes.push(outcome);
            closing.extend(opened.map(|opened| (name.clone(), opened)));
        }
        let couplings = forces.coupling_outcomes();
        // Replacements that were scheduled and not applied.
        let waiting = swaps.into_layers().into_iter();
        let (layers, reports) =
            last_words(&mut calls, &names, (forces, controls.take_retired()), &mut unresponsive);
        let Settled { first: health, faulty_plugins, replacements, hung } = controls.settle(reports);
        unresponsive = unresponsive.or(hung);
        let models = names.models().iter().cloned().zip(health);
        let models: Vec<_> = models.map(|(name, (health, words))| (name, health, words)).collect();
        warnings.extend(models.iter().filter_map(|(name, health, _)| health.notice(name)));
        let layers = layers.into_iter().chain(waiting);
        let layers = layers.map(|(model, layer)| (names.model(model), layer)).collect();
        let unfreed_plugins = UnfreedPlugins { devices: closing, models: layers, last_stop, calls };
        let wall_s = started.elapsed().as_secs_f64();
        warnings.extend(controls.warnings());
        warnings.extend(stop_time.as_ref().and_then(|time| time.warning(&names.all)));
        let taken = heartbeat.signals_taken();
        if !taken.is_none() {
            warnings.push(format!(
                "a plugin replaced {taken} of the host during the run; the host has restored them"
            ));
        }
        Outcome {
            warnings,
            known_before,
            end,
            timing,
            elapsed_ns,
            wall_s,
            dropped_records,
            real_time,
            stop_time,
            devices: outcomes,
            couplings,
            models,
            faulty_plugins,
            replacements,
            unresponsive,
            unfreed_plugins,
        }
    }
}

/// De-energises a stopped device; returns its outcome, and the opened device unless its plugin failed or hangs.
fn deactivate(
    calls: &mut CallThread,
    name: &str,
    (mut device, reported): (ActiveDevice, Reported),
    unresponsive: &mut Option<Unresponsive>,
) -> (DeviceOutcome, Option<OpenedDevice>) {
    let (who, float_changes) = (name.to_owned(), device.float_changes());
    let told = calls.run_to_end(move |progress| {
        progress.enter(&who, Call::Deactivate);
        let ledger = device.energy_ledger();
        let words = device.last_message();
        (ledger, words, device.deactivate())
    });
    let (ledger, words, opened) = told.unwrap_or_else(|error| {
        note(error, unresponsive);
        (None, String::new(), None)
    });
    let problem = reported.problem();
    let found = problem.clone().filter(|_| !reported.is_own_fault);
    let Reported { fault, implausible, effects, .. } = reported;
    let words = found.unwrap_or(words);
    (DeviceOutcome { fault, implausible, effects, problem, ledger, words, float_changes }, opened)
}

/// Layers, each with its model number.
type Layers = Vec<(usize, Layer)>;

/// Returns the layers, both of the loop and returned by it, and a report on each, with the last message of unhealthy models; returns
/// nothing if a call hangs.
fn last_words(
    calls: &mut CallThread,
    names: &PluginNames,
    (mut forces, mut retired): (Forces, Layers),
    unresponsive: &mut Option<Unresponsive>,
) -> (Layers, Vec<LayerReport>) {
    let names = names.clone();
    let told = calls.run_to_end(move |progress| {
        let on_query = |model: usize| progress.enter(&names.model(model), Call::LastMessage);
        let mut reports: Vec<LayerReport> =
            retired.iter_mut().map(|(model, layer)| layer.report(*model, || on_query(*model))).collect();
        reports.extend(forces.reports(on_query));
        (forces.into_layers().chain(retired).collect(), reports)
    });
    told.unwrap_or_else(|error| {
        note(error, unresponsive);
        (Vec::new(), Vec::new())
    })
}

/// Records the plugin that did not return, unless one is recorded already.
fn note(error: CallError, unresponsive: &mut Option<Unresponsive>) {
    if let CallError::Unresponsive(hung) = error {
        unresponsive.get_or_insert(hung);
    }
}
