//! Outcome of a run.

use super::{FaultyPlugin, PluginReport, StopTime, UnfreedPlugins};
use crate::calls::Unresponsive;
use flotor_core::plausibility::ImplausibleSamples;
use flotor_hal::{EnergyLedger, Fault};
use flotor_servo::{CouplingOutcome, EnvelopeEffects, ModelHealth, RealTimeReport, RunEnd, Stuck, Timing};

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
    pub(super) known_before: usize,
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
