//! End of a run: de-energises the devices, queries the last messages of the models, and creates the outcome.

use super::controls::Settled;
use super::{Controls, DeviceOutcome, Finished, Outcome, UnfreedPlugins};
use crate::calls::{Call, CallError, EndCalls, EndReserve, Progress, Unresponsive, end_limit};
use flotor_hal::abi::loader::{ActiveDevice, OpenedDevice};
use flotor_servo::{Dismantled, Forces, Heartbeat, Layer, LayerReport, Reported};
use std::time::Instant;

/// Data from the beginning of a run that its end needs.
pub(super) struct Epilogue {
    pub(super) started: Instant,
    pub(super) warnings: Vec<String>,
    pub(super) heartbeat: Heartbeat,
    pub(super) names: Vec<String>,
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
        let (mut told, mut closing) = (Vec::new(), Vec::new());
        let model_names = names.get(devices.len()..).unwrap_or_default();
        for (name, (device, reported)) in names.iter().zip(devices) {
            let (outcome, opened) = deactivate(&mut calls, name, (device, reported), &mut unresponsive);
            told.push(outcome);
            closing.extend(opened.map(|opened| (name.clone(), opened)));
        }
        let couplings = forces.coupling_outcomes();
        // Replacements that no tick will apply any more.
        let waiting = swaps.into_layers().into_iter();
        let (layers, reports) =
            last_words(&mut calls, model_names, (forces, controls.take_retired()), &mut unresponsive);
        let Settled { first: health, faulty_plugins, replacements, hung } = controls.settle(reports);
        unresponsive = unresponsive.or(hung);
        let models = model_names.iter().cloned().zip(health);
        let models = models.map(|(name, (health, words))| (name, health, words)).collect();
        let name = |number: usize| model_names.get(number).cloned().unwrap_or_default();
        let layers = layers.into_iter().chain(waiting).map(|(number, layer)| (name(number), layer)).collect();
        let unfreed_plugins = UnfreedPlugins::new(closing, layers, last_stop, calls);
        let wall_s = started.elapsed().as_secs_f64();
        warnings.extend(controls.warnings());
        warnings.extend(stop_time.as_ref().and_then(|time| time.warning(&names)));
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
            devices: told,
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
    calls: &mut EndCalls,
    name: &str,
    (mut device, reported): (ActiveDevice, Reported),
    unresponsive: &mut Option<Unresponsive>,
) -> (DeviceOutcome, Option<OpenedDevice>) {
    let (who, float_changes) = (name.to_owned(), device.float_changes());
    let told = calls.attended(end_limit(), move |progress| {
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
type Layers = Vec<(usize, Box<Layer>)>;

/// Returns reports on the layers in the loop and on those that it returned, with the last messages of unhealthy ones; and the
/// layers, unless a call hangs.
fn last_words(
    calls: &mut EndCalls,
    names: &[String],
    (mut forces, mut retired): (Forces, Layers),
    unresponsive: &mut Option<Unresponsive>,
) -> (Layers, Vec<LayerReport>) {
    let names = names.to_vec();
    let told = calls.attended(end_limit(), move |progress: &Progress| {
        let on_query =
            |model: usize| progress.enter(names.get(model).map_or("", String::as_str), Call::LastMessage);
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

/// Records the first plugin that did not return.
fn note(error: CallError, unresponsive: &mut Option<Unresponsive>) {
    if let CallError::Unresponsive(hung) = error {
        unresponsive.get_or_insert(hung);
    }
}
