//! Summary of a run: JSON for programs, text for users.

use crate::feel::Feel;
use crate::scene::{Isolation, Scene};
use crate::telemetry::LinkCounts;
use crate::{FaultyPlugin, Observer, Outcome, PluginReport, RunOptions};
use flotor_core::coupling::CouplingDescription;
use flotor_core::peer::TankState;
use flotor_core::trace::{Events, TickRecord};
use flotor_coupling::LinkStatistics;
use flotor_hal::{DVec3, Demand, EnergyLedger};
use flotor_servo::RunEnd;
use flotor_servo::{
    CouplingOutcome, Durations, EnvelopeEffects, ModelHealth, Overrun, Percentiles, Stage, StageEffect,
    Timing,
};
use serde::{Serialize, Serializer};

/// Observer that collects the tick statistics for the summary of a run.
#[derive(Default)]
pub struct Tally {
    /// Statistics of each device, by number.
    devices: Vec<DeviceTally>,
    event_ticks: [u64; Events::NAMES.len()],
    /// Events of the current tick, at any device.
    events: Events,
    generated_peak_j: f64,
    port_lowest_j: f64,
    /// Model outputs that were computed in every tick at every device; `None` before the first tick.
    computed: Option<Demand>,
}

/// Tick statistics of one device, from its records.
#[derive(Default)]
struct DeviceTally {
    peak_force_n: f64,
    peak_torque_nm: f64,
    last: Option<TickRecord>,
    balance: LoopBalance,
    port_lowest_j: f64,
    feel: Feel,
}

impl DeviceTally {
    fn observe(&mut self, record: &TickRecord) {
        self.peak_force_n = self.peak_force_n.max(record.commanded.force().length());
        self.peak_torque_nm = self.peak_torque_nm.max(record.commanded.torque().length());
        self.feel.observe(record);
        self.balance.observe(self.last.as_ref(), record);
        self.port_lowest_j = self.port_lowest_j.min(record.port_energy_j);
        self.last = Some(*record);
    }

    fn port_energy_j(&self) -> f64 {
        self.last.as_ref().map_or(0.0, |record| record.port_energy_j)
    }
}

/// Energy that the sampled loop generates at a device: work on the hand beyond the decrease of the energy stored in the models. Known
/// while all model outputs are computed and finite.
#[derive(Default)]
struct LoopBalance {
    /// Energy stored in the models in the first tick, J; `None` if not computed.
    first_energy_j: Option<f64>,
    work_j: f64,
    generated_j: Option<f64>,
}

impl LoopBalance {
    /// Adds the work of the models on the hand from one tick to the next; the wrench of the last tick acts until this tick
    /// (zero-order hold), as at the device.
    fn observe(&mut self, last: Option<&TickRecord>, record: &TickRecord) {
        let energy_j = record.model.energy_j();
        if last.is_none() {
            (self.first_energy_j, self.generated_j) = (energy_j, Some(0.0));
        }
        if let Some(last) = last {
            let moved = record.pose.position() - last.pose.position();
            let turn = record.pose.orientation() * last.pose.orientation().conjugate();
            let turned: DVec3 = flotor_hal::rotation_vector(turn);
            let torque = last.model.torque().unwrap_or(DVec3::NAN);
            self.work_j += last.model.force().dot(moved) + torque.dot(turned);
        }
        let stored = self.first_energy_j.zip(energy_j).filter(|_| self.generated_j.is_some());
        let generated_j = stored.map(|(first_j, now_j)| self.work_j - (first_j - now_j));
        self.generated_j = generated_j.filter(|joule| joule.is_finite());
    }
}

impl Tally {
    /// Returns the number of ticks with each event, at any device.
    fn event_ticks(&self) -> [u64; Events::NAMES.len()] {
        std::array::from_fn(|bit| self.event_ticks[bit] + u64::from(self.events.bits() >> bit & 1))
    }

    /// Returns the time of the last tick, ns; 0 before the first tick.
    #[must_use]
    pub fn last_ns(&self) -> u64 {
        let last = |device: &DeviceTally| device.last.as_ref().map(|record| record.time_ns);
        self.devices.iter().filter_map(last).max().unwrap_or(0)
    }

    /// Returns the largest energy that the loops of all devices together have generated at any time, J; `None` if it is not known to
    /// the end.
    fn generated_peak_j(&self) -> Option<f64> {
        let is_known = self.devices.iter().all(|device| device.balance.generated_j.is_some());
        is_known.then_some(self.generated_peak_j)
    }

    /// Returns the largest value over all devices; 0 without a device.
    fn largest(&self, number: impl Fn(&DeviceTally) -> f64) -> f64 {
        self.devices.iter().map(number).fold(0.0, f64::max)
    }
}

impl Observer for Tally {
    fn observe(&mut self, record: &TickRecord) {
        if record.device == 0 {
            // The previous tick is complete.
            self.event_ticks = self.event_ticks();
            self.events = Events::NONE;
        }
        self.events.insert(record.events);
        let computed = record.model.computed();
        self.computed = Some(self.computed.map_or(computed, |all| all.limited_to(computed)));
        let device = usize::from(record.device);
        if self.devices.len() <= device {
            self.devices.resize_with(device + 1, DeviceTally::default);
        }
        self.devices[device].observe(record);
        if device + 1 == self.devices.len() {
            let generated_j = self.devices.iter().filter_map(|device| device.balance.generated_j).sum();
            self.generated_peak_j = self.generated_peak_j.max(generated_j);
            let port_j = self.devices.iter().map(DeviceTally::port_energy_j).sum();
            self.port_lowest_j = self.port_lowest_j.min(port_j);
        }
    }
}

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
    pub events: std::collections::BTreeMap<&'static str, u64>,
    /// Digest of all records without measured times: equal for equal runs.
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

impl EnvelopeSummary {
    fn of(EnvelopeEffects { passivity, slew }: EnvelopeEffects) -> Self {
        let seconds = |effect: StageEffect| effect.active_ns as f64 * 1.0e-9;
        Self {
            passivity_active_s: seconds(passivity),
            passivity_removed_j: 0.0 - passivity.work_j, // not -0
            slew_active_s: seconds(slew),
            slew_generated_j: slew.work_j,
        }
    }

    fn sum(self, other: Self) -> Self {
        Self {
            passivity_active_s: self.passivity_active_s + other.passivity_active_s,
            passivity_removed_j: self.passivity_removed_j + other.passivity_removed_j,
            slew_active_s: self.slew_active_s + other.slew_active_s,
            slew_generated_j: self.slew_generated_j + other.slew_generated_j,
        }
    }

    /// Returns name and effect of each stage that was active, as text for users.
    fn rows(&self) -> impl Iterator<Item = (&'static str, String)> {
        let Self { passivity_active_s, passivity_removed_j, slew_active_s, slew_generated_j } = *self;
        let removed_mj = passivity_removed_j * 1.0e3;
        let generated_mj = slew_generated_j * 1.0e3;
        let passivity = format!("removed {removed_mj:.3} mJ in {passivity_active_s:.3} s");
        let slew = format!("generated {generated_mj:+.3} mJ in {slew_active_s:.3} s");
        let rows = [("passivity", passivity, passivity_active_s), ("slew limit", slew, slew_active_s)];
        let active = rows.into_iter().filter(|(.., active_s)| *active_s > 0.0);
        active.map(|(stage, text, _)| (stage, text))
    }
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
    pub parameters: std::collections::BTreeMap<String, String>,
    /// Error estimates of a model, by the id of the detail.
    #[serde(skip_serializing_if = "std::collections::BTreeMap::is_empty")]
    pub estimates: std::collections::BTreeMap<String, f64>,
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
    /// Digest of all records of the run.
    pub trace_digest: String,
}

impl LinkSummary {
    /// Formats the link statistics for users.
    fn to_text(&self) -> String {
        let Self { received_ticks, silences, longest_wait_ms, implausible, carried, .. } = self;
        let LinkCounts { lost, overtaken, refused, others, .. } = carried;
        let silent = match silences {
            0 => format!("longest wait for a message {longest_wait_ms:.0} ms"),
            silences => format!("force removed {silences} times for lack of messages"),
        };
        let unless_none = |count: u64, text: &dyn Fn(u64) -> String| match count {
            0 => String::new(),
            count => text(count),
        };
        let impossible = unless_none(*implausible, &|count| format!(", {count} implausible"));
        let partner = match self.partner.as_str() {
            "" => "no partner".to_owned(),
            run => format!("partner: run {run}"),
        };
        let others = unless_none(*others, &|others| format!(", {others} of other runs ignored"));
        let (cut_mj, cut_mm, cut_rad) = (self.cut_j * 1.0e3, self.cut_path_m * 1.0e3, self.cut_turn_rad);
        let cut = unless_none(self.cut_ticks, &|ticks| {
            format!("; claims rejected in {ticks} ticks: {cut_mj:.3} mJ, {cut_mm:.1} mm, {cut_rad:.3} rad")
        });
        let rejected_runs = match self.rejected_runs.as_slice() {
            [] => String::new(),
            runs => format!("; disconnected because of its claims: run {}", runs.join(", run ")),
        };
        format!(
            "{partner}; messages in {received_ticks} ticks, {silent}; {lost} lost, {overtaken} overtaken, {refused} \
             refused{impossible}{others}{cut}{rejected_runs}"
        )
    }
}

fn write_word<S: Serializer>(end: &RunEnd, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(end.word())
}

impl RunSummary {
    /// Creates the summary of a run.
    #[must_use]
    pub fn new(facts: RunFacts<'_>, outcome: &Outcome, tally: &Tally) -> Self {
        let Timing { ticks, late, missed, lateness, compute, stages } = &outcome.timing;
        let _ = Stage::Read; // the array below is in the order of `Stage`
        let [read, models, envelope, write] = stages.each_ref().map(Durations::percentiles);
        let events = Events::NAMES.iter().copied().zip(tally.event_ticks());
        let ledgers = || outcome.devices.iter().filter_map(|device| device.ledger);
        let elapsed_s = outcome.elapsed_ns as f64 * 1.0e-9;
        let needed = (facts.plugins.iter().zip(&tally.devices))
            .fold(Demand::ALL, |all, (device, _)| all.limited_to(device.at_hand.with(facts.requested)));
        // Without the outputs that only clients requested: the summary does not depend on clients.
        let computed = tally.computed.map_or(needed, |computed| computed.limited_to(needed));
        let outputs = [(Demand::TORQUE, "torque"), (Demand::ENERGY, "energy")];
        let absent = outputs.into_iter().filter(|(output, _)| !computed.contains(*output));
        let not_computed: Vec<&str> = absent.map(|(_, name)| name).collect();
        Self {
            title: facts.scene.title.clone(),
            end: outcome.end,
            clock: facts.options.clock.word(),
            seed: facts.options.seed,
            rate_hz: facts.scene.rate_hz,
            ticks: *ticks,
            late_ticks: *late,
            missed_ticks: *missed,
            elapsed_s,
            lateness_ns: lateness.percentiles(),
            compute_ns: compute.percentiles(),
            stages_ns: StageSummary { read, models, envelope, write },
            peak_force_n: tally.largest(|device| device.peak_force_n),
            peak_torque_nm: tally.largest(|device| device.peak_torque_nm),
            peak_stiffness_n_per_m: tally.largest(|device| device.feel.peak_stiffness_n_per_m),
            settled_after_s: (tally.devices.iter())
                .map(|device| device.feel.settled_after_s())
                .try_fold(0.0, |latest_s: f64, settled_s| Some(latest_s.max(settled_s?))),
            energy: EnergySummary {
                device_residual_relative: ledgers()
                    .map(relative_residual)
                    .max_by(|a, b| a.abs().total_cmp(&b.abs())),
                device_peak_j: ledgers().map(|ledger| ledger.peak_j).max_by(f64::total_cmp),
                loop_generated_j: tally.generated_peak_j().filter(|_| not_computed.is_empty()),
                port_lowest_j: tally.port_lowest_j,
                port_end_j: tally.devices.iter().map(DeviceTally::port_energy_j).sum(),
            },
            envelope: (outcome.devices.iter())
                .map(|device| EnvelopeSummary::of(device.effects))
                .fold(EnvelopeSummary::default(), EnvelopeSummary::sum),
            devices: (facts.plugins.iter().zip(&tally.devices).enumerate())
                .map(|(number, device)| device_summary(device, number, outcome))
                .collect(),
            couplings: (facts.scene.couplings.iter().zip(&outcome.couplings))
                .map(|(coupling, outcome)| coupling_summary(coupling, outcome, facts.carried))
                .collect(),
            events: events.filter(|(_, count)| *count > 0).collect(),
            trace_digest: facts.trace_digest,
            not_computed,
            dropped_records: outcome.dropped_records,
            wall_s: outcome.wall_s,
            warnings: outcome.warnings.clone(),
            plugins: (facts.plugins.iter().enumerate())
                .map(|(number, plugin)| plugin_summary(number, plugin, outcome))
                .chain(outcome.faulty_plugins.iter().map(faulty_plugin_summary))
                .collect(),
            replacements: outcome.replacements.iter().map(|plugin| replacement(plugin, outcome)).collect(),
        }
    }

    /// Sets the health of the plugins with this name to `what`: for the plugin that ended the run.
    #[must_use]
    pub fn with_health(mut self, name: &str, what: &str) -> Self {
        let cause = self.plugins.iter_mut().filter(|plugin| plugin.name == name);
        cause.for_each(|plugin| what.clone_into(&mut plugin.health));
        self
    }

    /// Formats plugins, rate, clock, peak force and digest in one line, for the title of a plot.
    #[must_use]
    pub fn one_line(&self) -> String {
        let plugins: Vec<&str> = self.plugins.iter().map(|plugin| plugin.id.as_str()).collect();
        let (plugins, rate_hz, clock) = (plugins.join(" + "), self.rate_hz, self.clock);
        format!(
            "{plugins}, {rate_hz} Hz, {clock} clock, peak {:.2} N, digest {}",
            self.peak_force_n, self.trace_digest
        )
    }

    /// Formats the summary as lines of text for users.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut lines = Vec::new();
        let mut row = |name: &str, text: String| lines.push(format!("  {name:<11}{text}"));
        let Self { elapsed_s, rate_hz, clock, wall_s, .. } = self;
        row("ran", format!("{elapsed_s:.3} s at {rate_hz} Hz, {clock} clock, {wall_s:.2} s wall"));
        row("ticks", format!("{}   late {}   missed {}", self.ticks, self.late_ticks, self.missed_ticks));
        if self.clock == "real" {
            row("lateness", percentiles(&self.lateness_ns));
        }
        row("compute", percentiles(&self.compute_ns));
        let StageSummary { read, models, envelope, write } = &self.stages_ns;
        let [read, models, envelope, write] =
            [read, models, envelope, write].map(|stage| duration(stage.p50));
        row("of which", format!("read {read}   models {models}   envelope {envelope}   write {write}"));
        row("peak", format!("{:.3} N   {:.4} N·m", self.peak_force_n, self.peak_torque_nm));
        if let (Some(residual), Some(peak_j)) =
            (self.energy.device_residual_relative, self.energy.device_peak_j)
        {
            row("energy", format!("peak {:.3} mJ, balanced to {:.1e} of it", peak_j * 1.0e3, residual.abs()));
        }
        let [lowest_mj, end_mj] =
            [self.energy.port_lowest_j, self.energy.port_end_j].map(|joule| joule * 1.0e3);
        row("port", format!("{end_mj:+.3} mJ at the end, {lowest_mj:+.3} mJ at the lowest"));
        self.envelope.rows().for_each(|(stage, text)| row(stage, text));
        if let Some(longest_ms) = self.devices.iter().filter_map(|device| device.stop_ms).reduce(f64::max) {
            row("stop", format!("{longest_ms:.1} ms from the request to no force"));
        }
        if self.devices.len() > 1 {
            for DeviceSummary { name, peak_force_n, peak_torque_nm, port_lowest_j, port_end_j, .. } in
                &self.devices
            {
                let [lowest_mj, end_mj] = [port_lowest_j, port_end_j].map(|joule| joule * 1.0e3);
                let peaks = format!("peak {peak_force_n:.3} N   {peak_torque_nm:.4} N·m");
                row(name, format!("{peaks}   port {end_mj:+.3} mJ, lowest {lowest_mj:+.3} mJ"));
            }
        }
        for CouplingSummary { name, lowest_j, discarded_j, link, .. } in &self.couplings {
            let [first, second] = lowest_j.map(|joule| joule * 1.0e3);
            let heat_mj = discarded_j.iter().sum::<f64>() * 1.0e3;
            let tanks = match link {
                None => {
                    format!("tanks never below {first:+.3} and {second:+.3} mJ, {heat_mj:.3} mJ dissipated")
                }
                Some(link) => format!(
                    "tank never below {first:+.3} mJ with {:.3} mJ accepted from the partner, whose tank was never \
                     below {second:+.3} mJ",
                    link.accepted_j * 1.0e3
                ),
            };
            row("coupling", format!("{name}: {tanks}"));
            link.iter().for_each(|link| row("link", format!("{name}: {}", link.to_text())));
        }
        if !self.events.is_empty() {
            let events: Vec<String> =
                self.events.iter().map(|(name, count)| format!("{name} {count}")).collect();
            row("events", events.join("   "));
        }
        if !self.not_computed.is_empty() {
            row("not computed", format!(": {}", self.not_computed.join(", ")));
        }
        if self.dropped_records > 0 {
            let dropped = self.dropped_records;
            row("dropped", format!("{dropped} records dropped for a slow observer; the loop did not wait"));
        }
        for plugin in &self.plugins {
            let health = if plugin.health == "ok" { String::new() } else { format!("  {}", plugin.health) };
            let place = if plugin.isolation == Some("process") { ", in a process of its own" } else { "" };
            row(plugin.kind, format!("{} {} ({}){place}{health}", plugin.id, plugin.version, plugin.file));
            for (name, value) in &plugin.estimates {
                row("", format!("{name} {value:.1e}, by the model's own estimate"));
            }
        }
        for PluginSummary { name, id, version, file, .. } in &self.replacements {
            row("model", format!("{id} {version} ({file}), in place of `{name}` at the end"));
        }
        for warning in &self.warnings {
            row("warning", warning.clone());
        }
        row("digest", self.trace_digest.clone());
        lines.join("\n")
    }
}

/// Returns the unexplained part of a device's own energy balance, relative to its peak energy; in J if the peak is 0.
fn relative_residual(ledger: EnergyLedger) -> f64 {
    if ledger.peak_j > 0.0 { ledger.residual_j() / ledger.peak_j } else { ledger.residual_j() }
}

fn device_summary(
    (plugin, tally): (&PluginReport, &DeviceTally),
    number: usize,
    outcome: &Outcome,
) -> DeviceSummary {
    let effects = outcome.devices.get(number).map(|device| device.effects);
    let stop_time = outcome.stop_time.as_ref().and_then(|time| time.of_device(number));
    DeviceSummary {
        name: plugin.name.clone(),
        peak_force_n: tally.peak_force_n,
        peak_torque_nm: tally.peak_torque_nm,
        port_lowest_j: tally.port_lowest_j,
        port_end_j: tally.port_energy_j(),
        envelope: effects.map(EnvelopeSummary::of).unwrap_or_default(),
        stop_ms: stop_time.map(|time| time.as_secs_f64() * 1.0e3),
    }
}

fn coupling_summary(
    coupling: &CouplingDescription,
    outcome: &CouplingOutcome,
    carried: &[(String, LinkCounts)],
) -> CouplingSummary {
    let each = |number: fn(&TankState) -> f64| outcome.tanks.each_ref().map(number);
    let carried = carried.iter().find(|(name, _)| *name == coupling.name).map(|(_, carried)| *carried);
    let link_summary = |link: LinkStatistics| LinkSummary {
        received_ticks: link.ticks,
        silences: link.silences,
        longest_wait_ms: link.longest_wait_ns as f64 * 1.0e-6,
        implausible: link.implausible,
        carried: carried.unwrap_or_default(),
        partner: if link.run == 0 { String::new() } else { link.run.to_string() },
        accepted_j: link.accepted_j,
        cut_j: link.cut.energy_j,
        cut_path_m: link.cut.path_m,
        cut_turn_rad: link.cut.turn_rad,
        cut_ticks: link.cut_ticks,
        rejected_runs: link.rejected_runs.iter().filter(|run| **run != 0).map(u64::to_string).collect(),
    };
    CouplingSummary {
        name: coupling.name.clone(),
        energy_gain: coupling.ends.energy_gain(),
        lowest_j: each(|tank| tank.lowest_j),
        gone_in_j: each(|tank| tank.gone_in_j),
        discarded_j: each(|tank| tank.discarded_j),
        link: outcome.link.map(link_summary),
    }
}

/// Returns the problem of a model as text; "ok" without a problem.
fn health_words(health: &ModelHealth, words: &str) -> String {
    let us = |ns: u64| ns as f64 * 1.0e-3;
    if let Some(tick) = health.panicked_at {
        return format!("panicked at tick {tick}, no force since: {words}");
    }
    if let Some(tick) = health.lost_at {
        return format!("process lost at tick {tick}, no force since: {words}");
    }
    if let Some(Overrun { tick, longest_ns, limit_ns }) = health.overrun {
        let (longest_us, limit_us) = (us(longest_ns), us(limit_ns));
        return format!(
            "took up to {longest_us:.0} µs a step, more than its {limit_us:.0} µs, and was faded out at tick {tick}"
        );
    }
    if let Some(tick) = health.first_late {
        return format!("late in {} ticks, the first at tick {tick}", health.late_ticks);
    }
    if let Some(tick) = health.first_rejected {
        let count = health.rejected_ticks;
        return format!(
            "{count} results were not finite, the first at tick {tick}; the host replaced each by zero force"
        );
    }
    if let Some(tick) = health.first_float_change {
        let ticks = health.float_changes;
        return format!(
            "changed the floating-point environment in {ticks} ticks, the first at tick {tick}; the host restored it \
             each time"
        );
    }
    "ok".to_owned()
}

/// Returns the summary of the plugin with this number; devices have the first numbers.
fn plugin_summary(number: usize, plugin: &PluginReport, outcome: &Outcome) -> PluginSummary {
    let device = outcome.devices.get(number);
    let float_changes = device.map_or(0, |device| device.float_changes);
    let float_changes = (float_changes > 0).then(|| {
        format!(
            "changed the floating-point environment in {float_changes} calls; the host restored it each time"
        )
    });
    let problem = device.and_then(|device| device.problem.clone());
    let model = outcome.models.iter().find(|(name, ..)| *name == plugin.name);
    let model = model.map(|(_, health, words)| health_words(health, words));
    summary_of(plugin, problem.or(float_changes).or(model).unwrap_or_else(|| "ok".to_owned()))
}

/// Returns the summary of a replacement with faults.
fn faulty_plugin_summary(FaultyPlugin { plugin, health, words }: &FaultyPlugin) -> PluginSummary {
    summary_of(plugin, health_words(health, words))
}

/// Returns the summary of a replacement in place at the end.
fn replacement(plugin: &PluginReport, outcome: &Outcome) -> PluginSummary {
    let same = |known: &&FaultyPlugin| {
        known.plugin.name == plugin.name && known.plugin.metadata.path == plugin.metadata.path
    };
    let faulty = outcome.faulty_plugins.iter().find(same);
    faulty.map_or_else(|| summary_of(plugin, "ok".to_owned()), faulty_plugin_summary)
}

fn summary_of(plugin: &PluginReport, health: String) -> PluginSummary {
    PluginSummary {
        name: plugin.name.clone(),
        id: plugin.metadata.id.clone(),
        kind: plugin.metadata.kind.name(),
        version: plugin.metadata.version.clone(),
        file: plugin.metadata.path.display().to_string(),
        isolation: plugin.isolation.map(Isolation::word),
        health,
        parameters: plugin.parameters.iter().cloned().collect(),
        estimates: plugin.estimates.iter().cloned().collect(),
    }
}

fn percentiles(p: &Percentiles) -> String {
    let [p50, p99, p999, max] = [p.p50, p.p99, p.p999, p.max].map(duration);
    format!("p50 {p50}   p99 {p99}   p99.9 {p999}   max {max}")
}

fn duration(ns: u64) -> String {
    match ns {
        0..1_000 => format!("{ns} ns"),
        1_000..1_000_000 => format!("{:.1} µs", ns as f64 * 1.0e-3),
        _ => format!("{:.2} ms", ns as f64 * 1.0e-6),
    }
}
