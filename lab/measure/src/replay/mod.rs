//! Replay of a recorded run without its device: the models are re-evaluated at the recorded poses.
//!
//! Without a change the wrench equals the recorded one bit for bit; with another parameter the difference is the effect
//! of the change on the same hand movement.

mod divergence;
mod error;
mod files;
mod held;
mod snapshot;
mod state;

pub use divergence::{Coverage, DivergenceCause};
pub use error::ReplayError;
use held::Held;
use state::Models;
pub use state::ReplayState;

use divergence::Evidence;
use files::as_recorded;
use flotor_core::coupling::{CouplingDescription, CouplingEnds};
use flotor_core::grip::GripRecord;
use flotor_core::health::ModelHealth;
use flotor_core::plausibility::{ImplausibleSamples, PlausibilityCheck};
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome, ChangeSubject, ModelOutputs, period_ns};
use flotor_coupling::{LinkTimeouts, Reach};
use flotor_hal::abi::PluginKind;
use flotor_hal::{Axes, Capabilities, Demand, DeviceState, LoopConfig, Tick};
use flotor_record::{Ending, Recording, Role, RunDescription};
use flotor_servo::{Clock, Coupled, Forces, Heartbeat, Port, Replacement};
use flotor_session::program;
use flotor_session::registry::Registry;
use flotor_session::scene::{
    Isolation, KeyValue, Location, ModelUse, ParameterText, PluginKeyValue, PluginUse,
};
use flotor_session::{PluginReport, RunError, prepare_model};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Timeouts of couplings with both ends on this host, which never wait.
const NO_TIMEOUTS: LinkTimeouts = LinkTimeouts { silence_ns: 0, fade_ns: 0 };

fn is_remote(coupling: &CouplingDescription) -> bool {
    matches!(coupling.ends, CouplingEnds::Remote(_))
}

/// Difference between replayed and recorded outputs of the models.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Difference {
    /// Number of ticks compared.
    pub ticks: u64,
    /// Number of ticks in which some bit of an output differs.
    pub differing_ticks: u64,
    /// First differing tick; `None` if no tick differs.
    pub first_tick: Option<u64>,
    /// Last differing tick; `None` if no tick differs.
    pub last_tick: Option<u64>,
    /// Largest difference of force, N.
    pub max_force_n: f64,
    /// Largest difference of torque, N·m; `None` where the recording contains no torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_torque_nm: Option<f64>,
    /// Root mean square of the difference of force, N.
    pub rms_force_n: f64,
    /// Root mean square of the difference of torque, N·m; `None` where the recording contains no torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_torque_nm: Option<f64>,
    /// Largest difference of stored energy, J; `None` where the recording contains no energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_energy_j: Option<f64>,
    /// Largest difference of the effort at a grip, N or N·m; `None` where the recording contains no grip.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_effort: Option<f64>,
}

/// Result of a replay.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Difference of the outputs.
    pub difference: Difference,
    /// Part of the run that the recording covers.
    pub coverage: Coverage,
    /// Cause of the difference; after a change, a further cause. `None` without a difference, or if the recording shows
    /// no further cause.
    pub why: Option<DivergenceCause>,
    /// End of the recording: complete or cut off.
    pub ending: Ending,
    /// Implausible recorded samples by device name, of devices with any.
    pub implausible: Vec<(String, ImplausibleSamples)>,
    /// Health of each model in this replay and its last message, in the scene's order.
    pub health: Vec<(ModelHealth, String)>,
    /// State requested by [`Replay::save_before`].
    pub state: Option<ReplayState>,
}

/// Models of a recording, ready for re-evaluation.
pub struct Replay<'r> {
    registry: &'r Registry,
    config: LoopConfig,
    recording: Recording,
    uses: Vec<ModelUse>,
    /// Number of devices.
    devices: usize,
    forces: Forces,
    plugins: Vec<PluginReport>,
    held: Held,
    /// State with which the comparison starts.
    start: Option<ReplayState>,
    /// Tick before which the state is saved.
    save_before: Option<u64>,
}

impl<'r> Replay<'r> {
    /// Opens a recording and creates its models as in the run, with other models and settings on top. Not real-time.
    ///
    /// # Errors
    /// [`ReplayError`] if the recording cannot be read, a model to be changed is not in the recording, a plugin is missing or
    /// rejects the settings, or a file named by a setting differs from the file in the run.
    pub fn open(
        path: &Path,
        registry: &'r Registry,
        models: &[KeyValue],
        sets: &[PluginKeyValue],
    ) -> Result<Self, ReplayError> {
        let recording = Recording::open(path)?;
        let mut uses = models_of(path, recording.run());
        let held = Held::apply(&mut uses, models, sets).map_err(ReplayError::Change)?;
        if let Some(lent) = uses.iter().find(|model| model.plugin.plugin == program::ID) {
            return Err(ReplayError::Program { model: lent.name.clone() });
        }
        use_recorded_files(&mut uses, &held, path, recording.run())?;
        let period_ns = period_ns(recording.run().rate_hz);
        let config = LoopConfig { period_ns, seed: recording.run().seed };
        let mut layers = Vec::new();
        let mut plugins = Vec::new();
        for model in &uses {
            let (layer, report) = prepare_model(registry, model, &config, Clock::Virtual)?;
            layers.push((model.devices(), layer));
            plugins.push(report);
        }
        let devices = recording.run().devices().count();
        let period_s = period_ns as f64 * 1.0e-9;
        if let Some(coupling) = recording.run().couplings.iter().find(|coupling| is_remote(coupling)) {
            return Err(ReplayError::RemoteCoupling(coupling.name.clone()));
        }
        let couplings = recording.run().couplings.iter();
        let couplings =
            couplings.map(|coupling| Coupled::new(coupling, period_s, NO_TIMEOUTS, Reach::default()).0);
        let forces = Forces::new(devices, layers, couplings.collect());
        let (start, save_before) = (None, None);
        Ok(Self { registry, config, recording, uses, devices, forces, plugins, held, start, save_before })
    }

    /// Returns the description of the run.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        self.recording.run()
    }

    /// Returns the models with the current value of every parameter.
    #[must_use]
    pub fn plugins(&self) -> &[PluginReport] {
        &self.plugins
    }

    /// Starts the comparison at the tick of a saved state: earlier ticks are read, but not evaluated.
    #[must_use]
    pub fn start_from(self, state: ReplayState) -> Self {
        Self { start: Some(state), ..self }
    }

    /// Saves the state of the models before a tick, for [`Compared::state`].
    #[must_use]
    pub fn save_before(self, tick: u64) -> Self {
        Self { save_before: Some(tick), ..self }
    }

    /// Evaluates the models at every recorded pose and compares their outputs with the recorded outputs. Calls `look` with each
    /// recorded tick and the outputs of the models in this replay, limited to the recorded outputs. Not real-time.
    ///
    /// # Errors
    /// [`ReplayError`] if the data are damaged, if a plugin swapped in during the run is rejected, or if a state cannot be saved or
    /// restored; the results of the earlier ticks are then lost.
    pub fn compare(
        mut self,
        mut look: impl FnMut(&TickRecord, &ModelOutputs),
    ) -> Result<Compared, ReplayError> {
        let mut difference = Difference::default();
        let mut evidence = Evidence::of(self.recording.run());
        let mut plausibility = vec![any_device(self.config.period_ns); self.devices];
        let heartbeat = Heartbeat::default(); // no watchdog observes a replay
        let mut ports: Vec<Port> =
            self.recording.run().devices().map(|device| Port::at_rest(device.at_hand)).collect();
        let mut records: Vec<TickRecord> = Vec::with_capacity(self.devices);
        let mut state = None;
        let starts_from_state = self.start.is_some();
        while let Some(record) = self.recording.next() {
            let record = record?;
            // Skip a tick that lost a record before the recording: it cannot be compared.
            if records.first().is_some_and(|first| first.tick != record.tick) {
                records.clear();
            }
            records.push(record);
            let [.., record] = records.as_slice() else { continue };
            // The changes before a tick precede its first record.
            for change in self.recording.take_changes() {
                self.repeat(&change)?;
            }
            let Some(port) = ports.get_mut(usize::from(record.device)) else { continue };
            port.state = DeviceState {
                pose: record.pose,
                twist: record.twist,
                buttons: record.buttons,
                ..DeviceState::HOME
            };
            port.grip = record.grip;
            port.events = Events::NONE;
            if let Some(check) = plausibility.get_mut(usize::from(record.device)) {
                look_at_sample(check, record);
            }
            if records.len() < self.devices {
                continue;
            }
            let tick = Tick { index: record.tick, time_ns: record.time_ns, dt_ns: record.dt_ns };
            while self.forces.take_faded(&tick).is_some() {}
            if self.is_before_start(&tick)? {
                records.clear();
                continue;
            }
            if self.save_before == Some(tick.index) {
                state = Some(self.models(&tick)?.save(tick.index)?);
            }
            // Compute all recorded outputs of the tick, and no more.
            let computed = |all: Demand, record: &TickRecord| all.with(record.model.computed());
            let observed = records.iter().fold(Demand::FORCE, computed);
            self.forces.step(&tick, &mut ports, observed, &heartbeat);
            evidence.look(tick.index, &records, &ports);
            let is_other =
                |(record, port): (&TickRecord, &Port)| differs(record, &replayed(port, record), port);
            if records.iter().zip(&ports).any(is_other) {
                evidence.differs(tick.index, &records, &ports);
            }
            for (port, record) in ports.iter_mut().zip(records.drain(..)) {
                let outputs = replayed(port, &record);
                difference.add(&record, &outputs, port);
                look(&record, &outputs);
                // Use the wrench that was commanded in the run.
                port.commanded = record.commanded;
            }
        }
        if let Some(record) = records.first() {
            evidence.coverage.break_off(record.tick);
        }
        if let Some(tick) =
            self.start.as_ref().map(|start| start.tick).or(self.save_before.filter(|_| state.is_none()))
        {
            return Err(ReplayError::NoSuchTick { tick });
        }
        difference.finish();
        let why = if self.held.is_nothing() { evidence.cause } else { evidence.other_cause() };
        // The state replaces what was before its tick.
        let why = why.map(|cause| match cause {
            DivergenceCause::JoinedLate { .. } if starts_from_state => DivergenceCause::OtherBuild,
            cause => cause,
        });
        let names = self.recording.run().devices().map(|device| device.name.clone());
        let found = plausibility.iter().map(PlausibilityCheck::found);
        let implausible = names.zip(found).filter(|(_, found)| found.first_tick().is_some()).collect();
        let (ending, health) = (self.recording.ending(), self.forces.health());
        Ok(Compared { difference, coverage: evidence.coverage, why, ending, implausible, health, state })
    }
}

impl<'r> Replay<'r> {
    /// Returns true before the tick of the state to start with; restores the state at its tick.
    fn is_before_start(&mut self, tick: &Tick) -> Result<bool, ReplayError> {
        match self.start.take() {
            Some(start) if tick.index < start.tick => {
                self.start = Some(start);
                Ok(true)
            }
            Some(start) if tick.index == start.tick => self.models(tick)?.restore(&start).map(|()| false),
            Some(start) => Err(ReplayError::NoSuchTick { tick: start.tick }),
            None => Ok(false),
        }
    }

    /// Returns the models if they have all of the history at a tick.
    fn models(&mut self, tick: &Tick) -> Result<Models<'_>, ReplayError> {
        let mut priorities = self.uses.iter().map(|model| model.blend.priority);
        let first = priorities.next();
        let what = if !self.recording.run().couplings.is_empty() {
            "devices are coupled"
        } else if priorities.any(|other| Some(other) != first) {
            "models of different priority fade"
        } else if self.forces.is_fading() {
            "a model is being replaced"
        } else {
            return Ok(Models { forces: &mut self.forces, reports: &self.plugins, config: &self.config });
        };
        Err(ReplayError::Entangled { what, tick: tick.index })
    }

    /// Repeats a parameter change of the run. Skips it if the user fixed another value, or if the model has no such
    /// parameter: the effect on the wrench is the result.
    fn repeat(&mut self, change: &Change) -> Result<(), ReplayError> {
        let names = |plugin: &PluginReport| plugin.name == change.plugin;
        let Some(model) = self.plugins.iter().position(names) else { return Ok(()) }; // a device
        let tick = Tick { index: change.tick, time_ns: change.time_ns, dt_ns: 0 };
        match change.subject {
            ChangeSubject::Weight => {
                self.forces.set_weight(model, &tick, change.number);
                return Ok(());
            }
            ChangeSubject::Plugin => return self.replace(model, change, &tick),
            ChangeSubject::Parameter => {}
        }
        let schema = self.plugins.get(model).map_or(&[][..], |plugin| plugin.schema);
        let is_held = self.held.keeps_parameter(&change.plugin, &change.parameter);
        let parameter = schema.iter().position(|parameter| parameter.id() == change.parameter);
        if let (Some(parameter), false, ChangeOutcome::Applied) = (parameter, is_held, change.outcome) {
            self.forces.set_parameter(model, &tick, parameter, change.number);
            let now = self.plugins.get_mut(model).and_then(|plugin| plugin.parameters.get_mut(parameter));
            if let Some((_, value)) = now {
                *value = change.number.to_string();
            }
        }
        Ok(())
    }

    /// Swaps a model as in the run, unless the user replaced the model for this replay.
    fn replace(&mut self, model: usize, change: &Change, tick: &Tick) -> Result<(), ReplayError> {
        let (Some(used), Some(report)) = (self.uses.get(model), self.plugins.get_mut(model)) else {
            return Ok(());
        };
        if self.held.keeps_plugin(&change.plugin) {
            return Ok(());
        }
        let settings: Vec<(&str, &str)> =
            change.settings.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
        let mut other = used.replaced_by(Some(&change.parameter), &settings);
        // Settings of the previous plugin may not fit this one. A plugin that cannot be loaded has no schema; the error
        // follows below.
        let plugin = self.registry.load(&other.plugin.plugin, PluginKind::Model);
        let schema = plugin.map_or(&[][..], |plugin| plugin.parameters());
        let is_known = |key: &str| schema.iter().any(|parameter| parameter.id() == key);
        let set = used.plugin.parameters.iter();
        let kept = set.filter(|set| self.held.keeps_parameter(&used.name, &set.key) && is_known(&set.key));
        other.plugin.parameters.extend(kept.cloned());
        let (layer, now) = prepare_model(self.registry, &other, &self.config, Clock::Virtual)?;
        *report = now;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count
        let generation = change.number as u16;
        drop(self.forces.replace(Replacement { model, generation, layer }, tick));
        Ok(())
    }
}

impl Difference {
    /// Adds one tick; the root mean squares contain sums until [`Self::finish`].
    fn add(&mut self, record: &TickRecord, outputs: &ModelOutputs, port: &Port) {
        self.ticks += 1;
        if differs(record, outputs, port) {
            self.differing_ticks += 1;
            self.first_tick.get_or_insert(record.tick);
            self.last_tick = Some(record.tick);
        }
        // Outputs have no distance if one of them is not finite.
        let finite = |distance: f64| if distance.is_finite() { distance } else { 0.0 };
        let force_n = (outputs.force() - record.model.force()).length();
        self.max_force_n = self.max_force_n.max(force_n);
        self.rms_force_n += force_n * force_n;
        if let Some((now, then)) = outputs.torque().zip(record.model.torque()) {
            let torque_nm = finite((now - then).length());
            self.max_torque_nm = Some(self.max_torque_nm.unwrap_or(0.0).max(torque_nm));
            self.rms_torque_nm = Some(self.rms_torque_nm.unwrap_or(0.0) + torque_nm * torque_nm);
        }
        if let Some((now, then)) = port.grip.zip(record.grip) {
            let effort = finite((now.model - then.model).abs());
            self.max_effort = Some(self.max_effort.unwrap_or(0.0).max(effort));
        }
        if let Some((now_j, then_j)) = outputs.energy_j().zip(record.model.energy_j()) {
            self.max_energy_j = Some(self.max_energy_j.unwrap_or(0.0).max(finite((now_j - then_j).abs())));
        }
    }

    fn finish(&mut self) {
        let ticks = self.ticks.max(1) as f64;
        self.rms_force_n = (self.rms_force_n / ticks).sqrt();
        self.rms_torque_nm = self.rms_torque_nm.map(|sum| (sum / ticks).sqrt());
    }

    /// Returns true if every bit of every tick is equal.
    #[must_use]
    pub fn is_bit_exact(&self) -> bool {
        self.differing_ticks == 0
    }
}

/// Returns true if some bit of the models' outputs now differs from the record, or of their effort at the grip.
fn differs(record: &TickRecord, outputs: &ModelOutputs, port: &Port) -> bool {
    let effort = |grip: Option<GripRecord>| grip.map(|grip| grip.model.to_bits());
    bits(outputs) != bits(&record.model) || effort(port.grip) != effort(record.grip)
}

/// Returns the plausibility check of a device of unknown capabilities, held by a hand.
fn any_device(period_ns: u64) -> PlausibilityCheck {
    PlausibilityCheck::new(&Capabilities { sensed: Axes::ALL, ..Capabilities::UNDRIVEN }, period_ns)
}

/// Checks a sample if it was new in the run: otherwise the record contains the last pose.
fn look_at_sample(check: &mut PlausibilityCheck, record: &TickRecord) {
    let without =
        [Events::STALE_SAMPLE, Events::NOT_FINITE, Events::IMPLAUSIBLE_SAMPLE, Events::DEVICE_FAULT];
    if without.into_iter().any(|event| record.events.intersects(event)) {
        return;
    }
    let tick = Tick { index: record.tick, time_ns: record.time_ns, dt_ns: record.dt_ns };
    let state = DeviceState {
        pose: record.pose,
        twist: record.twist,
        sampled_ns: record.time_ns,
        ..DeviceState::HOME
    };
    let _ = check.check(&tick, &state);
}

/// Returns the models' outputs now, limited to the recorded ones.
fn replayed(port: &Port, record: &TickRecord) -> ModelOutputs {
    port.outputs().limited_to(record.model.computed())
}

/// Returns the bits of the available outputs; every NaN is equal.
fn bits(outputs: &ModelOutputs) -> ([u64; 3], Option<[u64; 3]>, Option<u64>) {
    let bits = |number: f64| if number.is_nan() { f64::NAN.to_bits() } else { number.to_bits() };
    let torque = outputs.torque().map(|torque| torque.to_array().map(bits));
    (outputs.force().to_array().map(bits), torque, outputs.energy_j().map(bits))
}

/// Replaces files of the run's settings by files of equal content. Settings of this replay are unchanged.
fn use_recorded_files(
    uses: &mut [ModelUse],
    held: &Held,
    path: &Path,
    run: &RunDescription,
) -> Result<(), RunError> {
    let recorded = run.plugins.iter().filter(|plugin| plugin.role != Role::Device);
    for (model, then) in uses.iter_mut().zip(recorded) {
        let (name, plugin) = (&model.name, &mut model.plugin);
        for set in plugin.parameters.iter_mut().filter(|set| !held.keeps_parameter(name, &set.key)) {
            *set = as_recorded(set, name, &then.parameters, path)?;
        }
    }
    Ok(())
}

/// Returns the models of a recorded run as in a scene.
fn models_of(path: &Path, run: &RunDescription) -> Vec<ModelUse> {
    let location = Location { file: PathBuf::from(path), line: 0 };
    let parameter = |(key, value): &(String, String)| ParameterText {
        key: key.clone(),
        value: value.clone(),
        location: location.clone(),
    };
    let model = |plugin: &flotor_record::PluginDescription| match plugin.role {
        Role::Device => None,
        Role::Model(mapping) => Some(ModelUse {
            name: plugin.name.clone(),
            plugin: PluginUse {
                plugin: plugin.id.clone(),
                location: location.clone(),
                parameters: plugin.settings.iter().map(parameter).collect(),
            },
            device: plugin.device,
            mapping,
            places_m: plugin.places_m.clone(),
            shared_with: plugin.shared_with.clone(),
            blend: plugin.blend,
            isolation: Isolation::None, // no device, so no hand to protect
            field: plugin.field,
            budget_s: None,
            latency_s: run.devices().nth(usize::from(plugin.device)).map_or(0.0, |device| device.latency_s),
        }),
    };
    run.plugins.iter().filter_map(model).collect()
}
