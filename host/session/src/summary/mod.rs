//! Summary of a run: results as JSON for programs; as text for users by [`RunSummary::to_text`].

mod build;
mod text;

pub use flotor_core::tally::Tally;

use crate::scene::Scene;
use crate::telemetry::LinkCounts;
use crate::{PluginReport, RunOptions};
use flotor_hal::Demand;
use flotor_servo::{Percentiles, RunEnd};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Results of a run, written as JSON. The field names are a stable interface: scripts rely on them.
#[derive(Clone, Debug, Serialize)]
pub struct RunSummary {
    /// Title of the scene.
    pub title: String,
    /// Reason of the end, in JSON as its [word](RunEnd::word).
    #[serde(serialize_with = "write_word")]
    pub end: RunEnd,
    /// Clock of the loop: "real" or "virtual".
    pub clock: &'static str,
    /// Seed of the run.
    pub seed: u64,
    /// Requested loop rate, Hz.
    pub rate_hz: f64,
    /// Number of executed ticks.
    pub ticks: u64,
    /// Number of ticks that started late by more than a tenth of the period.
    pub late_ticks: u64,
    /// Number of ticks that were skipped because their whole period had passed.
    pub missed_ticks: u64,
    /// Time from the first deadline to the end of the last period, s.
    pub elapsed_s: f64,
    /// Lateness of the ticks after their deadlines, ns.
    pub lateness_ns: Percentiles,
    /// Compute times of whole ticks, ns.
    pub compute_ns: Percentiles,
    /// Compute times of the stages of a tick, ns, measured in a sample of the ticks.
    pub stages_ns: StageSummary,
    /// Largest magnitude of the commanded force at any device, N.
    pub peak_force_n: f64,
    /// Largest magnitude of the commanded torque at any device, N·m.
    pub peak_torque_nm: f64,
    /// Largest stiffness felt at a handle, N/m: increase of the force against the handle per displacement, over displacements of at
    /// least 0.1 mm in ticks without an event (limit, ramp, change).
    pub peak_stiffness_n_per_m: f64,
    /// Time after which every handle stayed within 0.1 mm and 1 mrad of one pose, s; `None` if a handle moved within the last half
    /// second.
    pub settled_after_s: Option<f64>,
    /// Energy balance of all devices together.
    pub energy: EnergySummary,
    /// Effects of the envelope's passivity controller and slew limit, summed over all devices.
    pub envelope: EnvelopeSummary,
    /// Summaries of the devices, in the scene's order.
    pub devices: Vec<DeviceSummary>,
    /// Summaries of the couplings, in the scene's order.
    pub couplings: Vec<CouplingSummary>,
    /// Number of ticks with each event, by name; events that did not happen are left out.
    pub events: BTreeMap<&'static str, u64>,
    /// Digest of the time, motion, wrenches, events and buttons of all records, without model outputs and measured times: equal for
    /// equal runs.
    pub trace_digest: String,
    /// Model outputs that were not computed in every tick ("torque", "energy"): not requested, or not available from every model.
    pub not_computed: Vec<&'static str>,
    /// Number of records dropped because an observer was too slow.
    pub dropped_records: u64,
    /// Wall-clock time from the start of the run to its outcome, s.
    pub wall_s: f64,
    /// Warnings for users, a sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Plugins of the run with the values of all parameters: devices, models, then replacements with faults.
    pub plugins: Vec<PluginSummary>,
    /// Replacements in place at the end, after hot swaps; without replacements that the seed chose.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub replacements: Vec<PluginSummary>,
}

/// Compute times of the stages of a tick, ns.
#[derive(Clone, Debug, Serialize)]
pub struct StageSummary {
    /// Applying parameter changes, and reading the devices.
    pub read: Percentiles,
    /// Mapping the poses and stepping the models.
    pub models: Percentiles,
    /// Limiting the wrenches.
    pub envelope: Percentiles,
    /// Writing the devices.
    pub write: Percentiles,
}

/// Summary of one device of a run.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceSummary {
    /// Name in the scene.
    pub name: String,
    /// Largest magnitude of the commanded force, N.
    pub peak_force_n: f64,
    /// Largest magnitude of the commanded torque, N·m.
    pub peak_torque_nm: f64,
    /// Largest magnitude of the commanded force at a linear grip, N; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_grip_force_n: Option<f64>,
    /// Largest magnitude of the commanded torque at an angular grip, N·m; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_grip_torque_nm: Option<f64>,
    /// Lowest net energy put in by the hand at the device's port, J; below zero: more energy came out than had gone in, for example
    /// from a coupled device.
    pub port_lowest_j: f64,
    /// Net energy put in by the hand at the device's port until the end, J.
    pub port_end_j: f64,
    /// Effects of the device's passivity controller and slew limit.
    pub envelope: EnvelopeSummary,
    /// Time from the request of an emergency stop until the device exerted no force, ms; absent without an emergency stop, and on the
    /// virtual clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_ms: Option<f64>,
}

/// Effects of the stages of the envelope that change the energy at a port.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct EnvelopeSummary {
    /// Time in which the passivity controller changed the wrench, s.
    pub passivity_active_s: f64,
    /// Energy that the passivity controller removed from the port, J.
    pub passivity_removed_j: f64,
    /// Time in which the slew limit changed the wrench, s.
    pub slew_active_s: f64,
    /// Energy that the slew limit generated at the port, J; negative: the slew limit removed energy.
    pub slew_generated_j: f64,
}

/// Summary of one coupling: energy tanks of its two ends. Energies are in the shared frame of the coupling.
#[derive(Clone, Debug, Serialize)]
pub struct CouplingSummary {
    /// Name in the scene.
    pub name: String,
    /// Largest ratio of the energy delivered to one hand to the energy that the other hand puts in; depends on the scales of the ends
    /// alone.
    pub energy_gain: f64,
    /// Lowest energy of the tank of each end, J; below zero: more energy came out at this end than its tank had and received. The
    /// value of a remote end is reported by its host and cannot be verified here.
    pub lowest_j: [f64; 2],
    /// Net energy that the hand at each end put in, J; negative: more came out.
    pub gone_in_j: [f64; 2],
    /// Energy put in at each end that its tank has discarded (dissipated), J.
    #[serde(rename = "given_up_j")]
    pub discarded_j: [f64; 2],
    /// Link statistics, if the second end is remote; the energies of the remote end are the last received values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<LinkSummary>,
}

/// Statistics of the link between two hosts.
#[derive(Clone, Debug, Serialize)]
pub struct LinkSummary {
    /// Number of ticks in which a message arrived.
    #[serde(rename = "heard_ticks")]
    pub received_ticks: u64,
    /// Number of timeouts: no message arrived for the watchdog timeout, and the coupling removed its force.
    pub silences: u64,
    /// Longest wait for a message without a timeout, ms.
    pub longest_wait_ms: f64,
    /// Number of messages with an implausible pose or velocity, which were not used.
    pub implausible: u64,
    /// Counts of the messages received by the peer link.
    pub carried: LinkCounts,
    /// Id of the partner's run, its start in ns since 1970, as text; empty without a partner.
    pub partner: String,
    /// Energy accepted from the partner, J. The energy delivered to the local hand is at most this energy plus the energy that the
    /// local hand put in.
    #[serde(rename = "believed_j")]
    pub accepted_j: f64,
    /// Rejected energy, J: claimed by the partner beyond the part that can be verified here.
    pub cut_j: f64,
    /// Travel claimed by the partner beyond the plausible limit, m.
    pub cut_path_m: f64,
    /// Rotation claimed by the partner beyond the plausible limit, rad.
    pub cut_turn_rad: f64,
    /// Number of ticks with a rejected claim, or with a position beyond the range of the local device.
    pub cut_ticks: u64,
    /// Ids of the partner runs that were disconnected because of implausible claims, as text.
    #[serde(rename = "let_go")]
    pub rejected_runs: Vec<String>,
}

/// Energy balance of a run.
#[derive(Clone, Debug, Serialize)]
pub struct EnergySummary {
    /// Unexplained part of a device's own energy balance, relative to its peak energy (in J if the peak is 0); of several devices
    /// the largest in magnitude. Absent if no device keeps a balance.
    pub device_residual_relative: Option<f64>,
    /// Largest mechanical energy of a device, J; absent if no device keeps a balance.
    pub device_peak_j: Option<f64>,
    /// Largest energy that the sampled loop has generated, J: work on the hand beyond the decrease of the energy stored in the
    /// models, as by the zero-order hold. Absent if torque or energy of the models was not computed in every tick, or was not finite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_generated_j: Option<f64>,
    /// Lowest net energy put in by the hands at the ports of all devices together, J; below zero: more energy came out at some time
    /// than had gone in.
    pub port_lowest_j: f64,
    /// Net energy put in by the hands at all ports until the end, J.
    pub port_end_j: f64,
}

/// Summary of a plugin of a run: identity, health and parameters.
#[derive(Clone, Debug, Serialize)]
pub struct PluginSummary {
    /// Name in the scene.
    pub name: String,
    /// Id of the plugin.
    pub id: String,
    /// Kind of the plugin: "model" or "device".
    pub kind: &'static str,
    /// Version of the plugin.
    pub version: String,
    /// Path of the plugin file; empty for a linked plugin.
    pub file: String,
    /// Isolation of a model, as `isolation` of a scene: "process" for a worker process, "none" for the loop's own thread; absent for
    /// a device.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub isolation: Option<&'static str>,
    /// Health of the plugin: "ok", or the problem.
    pub health: String,
    /// Value of every parameter before the run, as text, by id.
    pub parameters: BTreeMap<String, String>,
    /// Error estimates of a model, by the id of the detail.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub estimates: BTreeMap<String, f64>,
}

/// Inputs of a summary in addition to outcome and tally.
pub struct RunFacts<'a> {
    /// Scene of the run.
    pub scene: &'a Scene,
    /// Options of the run.
    pub options: &'a RunOptions,
    /// Plugins of the run: devices, then models, in the scene's order.
    pub plugins: &'a [PluginReport],
    /// Model outputs that the observer of the run requested; without the outputs that clients requested.
    pub requested: Demand,
    /// Counts of messages between hosts, by the name of the coupling.
    pub carried: &'a [(String, LinkCounts)],
    /// Digest of all records of the run, as in [`RunSummary::trace_digest`].
    pub trace_digest: String,
}

fn write_word<S: Serializer>(end: &RunEnd, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(end.word())
}
