//! Construction of a summary from outcome and tick statistics.

use super::{
    CouplingSummary, DeviceSummary, EnergySummary, EnvelopeSummary, LinkSummary, PluginSummary, RunFacts,
    RunSummary, StageSummary,
};
use crate::scene::Isolation;
use crate::telemetry::LinkCounts;
use crate::{FaultyPlugin, Outcome, PluginReport};
use flotor_core::coupling::CouplingDescription;
use flotor_core::peer::TankState;
use flotor_core::tally::{DeviceTally, Tally};
use flotor_core::trace::Events;
use flotor_coupling::LinkStatistics;
use flotor_hal::{Demand, EnergyLedger, GripKind};
use flotor_servo::{CouplingOutcome, Durations, EnvelopeEffects, Stage, StageEffect, Timing};

impl RunSummary {
    /// Creates the summary of a run from its inputs, its outcome and the counts over its ticks.
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
            peak_stiffness_n_per_m: tally.largest(|device| device.feel.peak_stiffness_n_per_m()),
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
        peak_grip_force_n: tally.peak_effort(GripKind::Linear),
        peak_grip_torque_nm: tally.peak_effort(GripKind::Angular),
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
    let model = model.and_then(|(_, health, words)| health.problem(words));
    summary_of(plugin, problem.or(float_changes).or(model))
}

/// Returns the summary of a replacement with faults.
fn faulty_plugin_summary(FaultyPlugin { plugin, health, words }: &FaultyPlugin) -> PluginSummary {
    summary_of(plugin, health.problem(words))
}

/// Returns the summary of a replacement in place at the end.
fn replacement(plugin: &PluginReport, outcome: &Outcome) -> PluginSummary {
    let same = |known: &&FaultyPlugin| {
        known.plugin.name == plugin.name && known.plugin.metadata.path == plugin.metadata.path
    };
    let faulty = outcome.faulty_plugins.iter().find(same);
    faulty.map_or_else(|| summary_of(plugin, None), faulty_plugin_summary)
}

/// Returns the summary of a plugin with this problem, if any.
fn summary_of(plugin: &PluginReport, problem: Option<String>) -> PluginSummary {
    PluginSummary {
        name: plugin.name.clone(),
        id: plugin.metadata.id.clone(),
        kind: plugin.metadata.kind.name(),
        version: plugin.metadata.version.clone(),
        file: plugin.metadata.path.display().to_string(),
        isolation: plugin.isolation.map(Isolation::word),
        health: problem.unwrap_or_else(|| "ok".to_owned()),
        parameters: plugin.parameters.iter().cloned().collect(),
        estimates: plugin.estimates.iter().cloned().collect(),
    }
}
