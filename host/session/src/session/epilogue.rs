//! End of a run: de-energises the devices, queries the last messages of the models, and creates the outcome.

use super::controls::Settled;
use super::plugin_report::PluginNames;
use super::{Controls, DeviceOutcome, Outcome, StopTime, UnfreedPlugins};
use crate::calls::{Call, CallError, CallThread, EndReserve, Progress, Unresponsive, end_limit};
use flotor_hal::abi::loader::{ActiveDevice, OpenedDevice};
use flotor_servo::{
    Dismantled, Forces, Heartbeat, Layer, LayerReport, Loop, RealTimeReport, Reported, RunEnd, Servo,
};
use std::time::Instant;

/// Loop that has ended, with its devices stopped.
pub(super) struct Finished {
    pub(super) servo: Servo,
    pub(super) end: RunEnd,
    pub(super) elapsed_ns: u64,
    pub(super) dropped_records: u64,
    pub(super) real_time: RealTimeReport,
    /// `None` without an emergency stop on the real clock.
    pub(super) stop_time: Option<StopTime>,
    /// Warning for users, which was shown already.
    pub(super) warning: Option<String>,
}

impl Finished {
    pub(super) fn of(ended: Loop, dropped_records: u64, real_time: RealTimeReport) -> Self {
        let (servo, end, elapsed_ns) = ended.finish();
        Self { servo, end, elapsed_ns, dropped_records, real_time, stop_time: None, warning: None }
    }
}

/// Data from the beginning of a run that its end needs.
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
        for (name, device) in names.all().iter().zip(devices) {
            let (outcome, opened) = deactivate(&mut calls, name, device, &mut unresponsive);
            outcomes.push(outcome);
            closing.extend(opened.map(|opened| (name.clone(), opened)));
        }
        let couplings = forces.coupling_outcomes();
        // Replacements that no tick will apply any more.
        let waiting = swaps.into_layers().into_iter();
        let (layers, reports) =
            last_words(&mut calls, &names, (forces, controls.take_retired()), &mut unresponsive);
        let Settled { first: health, faulty_plugins, replacements, hung } = controls.settle(reports);
        unresponsive = unresponsive.or(hung);
        let models = names.models().iter().cloned().zip(health);
        let models = models.map(|(name, (health, words))| (name, health, words)).collect();
        let layers = layers.into_iter().chain(waiting);
        let layers = layers.map(|(model, layer)| (names.model(model), layer)).collect();
        let unfreed_plugins = UnfreedPlugins::new(closing, layers, last_stop, calls);
        let wall_s = started.elapsed().as_secs_f64();
        warnings.extend(controls.warnings());
        warnings.extend(stop_time.as_ref().and_then(|time| time.warning(names.all())));
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

/// De-energises a stopped device; returns its outcome, and the device unless its plugin failed or hangs.
fn deactivate(
    calls: &mut CallThread,
    name: &str,
    (mut device, reported): (ActiveDevice, Reported),
    unresponsive: &mut Option<Unresponsive>,
) -> (DeviceOutcome, Option<OpenedDevice>) {
    let (who, float_changes) = (name.to_owned(), device.float_changes());
    let told = calls.run_while(
        end_limit(),
        || true,
        move |progress| {
            progress.enter(&who, Call::Deactivate);
            let ledger = device.energy_ledger();
            let words = device.last_message();
            (ledger, words, device.deactivate())
        },
    );
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
type Layers = Vec<(usize, Box<Layer>)>;

/// Returns reports on the layers in the loop and on those that it returned, with the last messages of unhealthy ones; and the
/// layers, unless a call hangs.
fn last_words(
    calls: &mut CallThread,
    names: &PluginNames,
    (mut forces, mut retired): (Forces, Layers),
    unresponsive: &mut Option<Unresponsive>,
) -> (Layers, Vec<LayerReport>) {
    let names = names.clone();
    let told = calls.run_while(
        end_limit(),
        || true,
        move |progress: &Progress| {
            let on_query = |model: usize| progress.enter(&names.model(model), Call::LastMessage);
            let mut reports: Vec<LayerReport> =
                retired.iter_mut().map(|(model, layer)| layer.report(*model, || on_query(*model))).collect();
            reports.extend(forces.reports(on_query));
            (forces.into_layers().chain(retired).collect(), reports)
        },
    );
    told.unwrap_or_else(|error| {
        note(error, unresponsive);
        (Vec::new(), Vec::new())
    })
}

/// Records the first plugin that did not return.
fn note(error: CallError, unresponsive: &mut Option<Unresponsive>) {
    if let CallError::Unresponsive(hung) = error {
        unresponsive.get_or_insert(hung);
    }
}
