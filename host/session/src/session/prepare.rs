//! Preparation of a scene: loads plugins, checks their settings, and pairs scene and devices.

use super::choice::chosen;
use super::controls::{ChosenBy, ControlError, NewValue, PluginTable, understands};
use super::stop_without_host::StopWithoutHost;
use super::{PluginReport, RunError};
use crate::calibration_file::{CalibrationFile, CalibrationFileError};
use crate::calls::{Call, Progress, attended_while, is_to_begin, keeping_machine, limit};
use crate::estimates;
use crate::registry::{LookupError, Registry, is_installed};
use crate::scene::{
    Alternative, CalibrationUse, ChangeUse, ChangeWhat, DeviceUse, Isolation, ModelUse, Pacing,
    ParameterText, PluginUse, Scene, SceneError,
};
use flotor_core::limits::Boundary;
use flotor_core::mapping::Mapping;
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{LoadError, Metadata, OpenedDevice, Plugin, Setting, Stopper};
use flotor_hal::{
    Axes, Capabilities, DVec3, Demand, Embodiment, LoopConfig, Parameter, ParameterKind, Refusal,
    SampledLoop, SoftRange,
};
use flotor_servo::engine::asynchronous::AsynchronousModel;
use flotor_servo::engine::process::{Worker, WorkerConfig};
use flotor_servo::last_stop::{SignalGuard, TakenSignals};
use flotor_servo::{
    Clock, Engine, Layer, Replacement, ScheduledChange, Servo, Standby, TimeBudget, pushes_at_home,
};
use std::borrow::Cow;
use std::time::Duration;

pub(super) fn load(registry: &Registry, plugin: &PluginUse, kind: PluginKind) -> Result<Plugin, RunError> {
    registry.load(&plugin.plugin, kind).map_err(|error| not_found(plugin, error))
}

/// Checks that the plugins of a scene exist, without running their code. Not real-time.
///
/// # Errors
/// [`RunError`], with the line of the scene.
pub fn check_plugins(scene: &Scene, registry: &Registry) -> Result<(), RunError> {
    let devices = scene.devices.iter().map(|device| (&device.plugin, PluginKind::Device));
    let models = scene.models.iter().map(|model| (&model.plugin, PluginKind::Model));
    devices.chain(models).try_for_each(|(plugin, kind)| {
        registry.check(&plugin.plugin, kind).map_err(|error| not_found(plugin, error))
    })
}

fn not_found(plugin: &PluginUse, error: LookupError) -> RunError {
    match RunError::from(error) {
        wrong if wrong.is_configuration() => plugin.location.problem(wrong.to_string()).into(),
        refused => refused,
    }
}

/// Returns the error about a plugin that refused.
pub(super) fn refused(metadata: &Metadata, refusal: Refusal) -> RunError {
    let Metadata { path, id, .. } = metadata.clone();
    RunError::Plugin(LoadError::Refused { path, id, refusal })
}

/// Energises the devices of a run right before its first tick, each within a time limit. Not real-time.
pub(super) fn activate(standby: Standby, plugins: &[PluginReport]) -> Result<Servo, RunError> {
    let (plugins, stoppers) = (plugins.to_vec(), standby.stoppers());
    let activated =
        attended_while(limit(), is_to_begin, move |progress| activate_here(standby, &plugins, progress));
    let activated = activated.inspect_err(|_| stoppers.iter().for_each(Stopper::safe_stop))?;
    activated.inspect(Servo::register_loop_thread)
}

/// Energises the devices on this thread, while another thread polls the progress. Not real-time.
pub(super) fn activate_here(
    standby: Standby,
    plugins: &[PluginReport],
    progress: &Progress,
) -> Result<Servo, RunError> {
    let enters = |device: usize| {
        progress.enter(plugins.get(device).map_or("", |plugin| plugin.name.as_str()), Call::Activate);
    };
    let names = plugins.iter().map(|plugin| plugin.name.clone()).collect();
    let activated = standby.activate(names, enters);
    progress.exit();
    activated.map_err(|(device, refusal)| match plugins.get(device) {
        Some(report) => refused(&report.metadata, refusal),
        None => RunError::Thread("names a device that the scene does not have"),
    })
}

/// Passes the scene's calibration to the device that it was measured on. Not real-time.
fn calibrate(
    plugin: &Plugin,
    device: &mut OpenedDevice,
    calibration: &CalibrationUse,
) -> Result<(), RunError> {
    let path = calibration.path();
    let wrong = |problem: CalibrationFileError| calibration.location.problem(problem.to_string());
    let (file, curve) = CalibrationFile::load(&path).map_err(wrong)?;
    let id = &plugin.metadata().id;
    file.check_device(&path.display().to_string(), id, &device.serial()).map_err(wrong)?;
    device.calibrate_vertical(&curve).map_err(|refusal| refused(plugin.metadata(), refusal))
}

/// Opened device, not energised.
pub(super) struct Opened {
    pub(super) device: OpenedDevice,
    pub(super) capabilities: Capabilities,
    pub(super) embodiment: Embodiment,
    /// Stop of the device after the end of this process.
    pub(super) stop: StopWithoutHost,
}

/// Returns a warning if models may request torque that the device lacks, unless the scene wants none. No mismatch: a model declares
/// that it can compute torque, not that it will.
pub(super) fn without_torque(scene: &Scene, number: u16, device: &Capabilities) -> Option<String> {
    let is_driven = device.actuated != Axes::NONE && !device.actuated.contains(Axes::ROTATION);
    let is_felt = scene.models.iter().any(|model| model.device == number);
    let is_wanted = scene.limits.torque_nm.axes().iter().any(|most_nm| *most_nm > 0.0);
    (is_driven && is_felt && is_wanted).then(|| {
        let name = scene.devices.get(usize::from(number)).map_or("", |device| device.name.as_str());
        format!(
            "`{name}` exerts no torque, so the hand cannot feel the torque of a model; `[limits] torque_nm = [0, 0, \
             0]` accepts this"
        )
    })
}

/// Returns a warning for each coupling that amplifies, with the scene's consent.
pub(super) fn amplifications(scene: &Scene) -> impl Iterator<Item = String> + '_ {
    let gains = scene.couplings.iter().map(|coupling| (&coupling.name, coupling.ends.energy_gain()));
    gains.filter(|(_, gain)| *gain > 1.0).map(|(name, gain)| {
        format!(
            "the coupling `{name}` amplifies: one hand may get {gain:.4} times the energy that the other puts in \
             (`allow_amplification`)"
        )
    })
}

/// Loads and opens one device of a scene. Not real-time.
pub(super) fn open_device(
    registry: &Registry,
    device: &DeviceUse,
) -> Result<(Opened, PluginReport), RunError> {
    let DeviceUse { name, plugin: used, calibration } = device;
    let signals = SignalGuard::take();
    let plugin = load(registry, used, PluginKind::Device)?;
    let settings = settings(&plugin, name, &used.parameters)?;
    let (who, opening, given) = (name.clone(), plugin.clone(), settings.clone());
    let embodiment = plugin.device_info().map_or(Embodiment::Physical, |info| info.embodiment());
    let open = move |progress: &Progress| {
        progress.enter(&who, Call::Open);
        let refuse = |refusal| refused(opening.metadata(), refusal);
        let mut device = opening.open_device(&given)?;
        let capabilities = device.capabilities().map_err(refuse)?;
        let stop = StopWithoutHost::of(&who, embodiment, &capabilities, &mut device).map_err(refuse)?;
        let values: Vec<f64> = (0..opening.parameters().len()).map(|index| device.parameter(index)).collect();
        Ok::<_, RunError>((device, capabilities, stop, values))
    };
    let (mut device, capabilities, stop, values) =
        keeping_machine(name, || attended_while(limit(), is_to_begin, open))??;
    let mut report = report(&plugin, name, used, &settings, |index| value_at(&values, index));
    if let Some(calibration) = calibration {
        calibrate(&plugin, &mut device, calibration)?;
    }
    report.signals_taken = signals.put_back();
    report.latency_s = capabilities.latency_s;
    Ok((Opened { device, capabilities, embodiment, stop }, report))
}

/// Returns the value of a parameter; NaN without one.
fn value_at(values: &[f64], index: usize) -> f64 {
    values.get(index).copied().unwrap_or(f64::NAN)
}

/// Loads one model of a scene and creates it in all its places. Not real-time.
///
/// # Errors
/// [`RunError`]: the plugin is unknown, was rejected, refused, or does not return.
pub fn prepare_model(
    registry: &Registry,
    model: &ModelUse,
    config: &LoopConfig,
    clock: Clock,
) -> Result<(Layer, PluginReport), RunError> {
    prepare_model_while(registry, model, config, clock, is_to_begin)
}

/// Prepares a model like [`prepare_model`], but only while it is wanted.
pub(super) fn prepare_model_while(
    registry: &Registry,
    model: &ModelUse,
    config: &LoopConfig,
    clock: Clock,
    is_wanted: impl Fn() -> bool,
) -> Result<(Layer, PluginReport), RunError> {
    let signals = SignalGuard::take();
    let plugin = load(registry, &model.plugin, PluginKind::Model)?;
    let settings = settings(&plugin, &model.name, &model.plugin.parameters)?;
    let builder = ModelBuilder {
        isolation: isolation(model, plugin.metadata(), clock)?,
        plugin: plugin.clone(),
        settings: settings.clone(),
        model: model.clone(),
        config: *config,
        clock,
    };
    let isolation = builder.isolation;
    let most = match isolation {
        // A worker that is not ready in time has to be ended, not abandoned.
        Isolation::Process => limit() + END_OF_A_WORKER,
        Isolation::ByOrigin | Isolation::None => limit(),
    };
    let make = move |progress: &Progress| builder.layer(progress);
    let (layer, values, estimates) = keeping_machine(&model.name, || attended_while(most, is_wanted, make))??;
    let mut report = report(&plugin, &model.name, &model.plugin, &settings, |index| value_at(&values, index));
    report.signals_taken = signals.put_back();
    report.estimates = estimates;
    report.isolation = Some(isolation);
    Ok((layer, report))
}

/// Turns off isolation by origin where no hand is: on the virtual clock and on simulated devices.
pub(super) fn settle_isolation(model: &mut ModelUse, clock: Clock, simulated: &[bool]) {
    let is_felt = clock == Clock::Real && simulated.get(usize::from(model.device)) != Some(&true);
    if model.isolation == Isolation::ByOrigin && !is_felt {
        model.isolation = Isolation::None;
    }
}

/// Time for ending a worker whose model was not created in time.
const END_OF_A_WORKER: Duration = Duration::from_secs(10);

/// Most instances of a model that get a process each without the scene's explicit request.
const MAX_PROCESSES: usize = 64;

/// Resolves the isolation of a model by its origin.
fn isolation(model: &ModelUse, plugin: &Metadata, clock: Clock) -> Result<Isolation, SceneError> {
    let is_outside = clock == Clock::Real && !is_installed(&plugin.path);
    match model.isolation {
        Isolation::ByOrigin if is_outside && model.places_m.len() > MAX_PROCESSES => {
            let objects = model.places_m.len();
            Err(complain(
                model,
                &format!(
                    "the plugin is from outside the installation, and each of its {objects} objects would have a process \
                     of its own; set `isolation = \"process\"` or `isolation = \"none\"`"
                ),
            ))
        }
        Isolation::ByOrigin if is_outside => Ok(Isolation::Process),
        Isolation::ByOrigin => Ok(Isolation::None),
        said => Ok(said),
    }
}

/// Error estimates of a model, by the names of its details.
type Estimates = Vec<(String, f64)>;

/// Inputs for creating a model.
struct ModelBuilder {
    isolation: Isolation,
    plugin: Plugin,
    settings: Vec<Setting>,
    model: ModelUse,
    config: LoopConfig,
    clock: Clock,
}

impl ModelBuilder {
    /// Creates the model in all its places; returns it with the values of its parameters and its error estimates. Runs the plugin's code.
    fn layer(&self, progress: &Progress) -> Result<(Layer, Vec<f64>, Estimates), RunError> {
        let Self { plugin, model, config, clock, .. } = self;
        let budget_ns = budget_ns(model, *clock, config.period_ns);
        let mapping = Mapping::new(&model.mapping);
        let instance = |place_m: &[f64; 3]| {
            let (mut engine, mapping) = (self.engine(budget_ns, progress)?, mapping.at(*place_m));
            if pushes_at_home(&engine.workspace_bounds(), &mapping) {
                let problem = format!(
                    "at {} mm the workspace limits of the model exclude the home of its device, and the wall at these \
                     limits would push there; move the model (`position_mm`) or choose parameters that extend its limits",
                    DVec3::from(*place_m) * 1.0e3
                );
                return Err(complain(model, &problem).into());
            }
            Ok((engine, mapping))
        };
        let mut instances = model.places_m.iter().map(instance).collect::<Result<Vec<_>, RunError>>()?;
        let mut value = |index| instances.first_mut().map_or(f64::NAN, |(first, _)| first.parameter(index));
        let values = (0..plugin.parameters().len()).map(&mut value).collect();
        let estimates = match instances.first_mut() {
            Some((Engine::Here(model), _)) => estimates(model),
            _ => Vec::new(), // a worker returns wrenches only
        };
        let estimates =
            estimates.into_iter().map(|(detail, value)| (detail.id().to_owned(), value)).collect();
        let budget = match (self.isolation, &model.field) {
            // The loop waits no longer than the budget, and a late reply counts as an overrun.
            (Isolation::Process, None) => TimeBudget::new(Some(budget_ns.unwrap_or(PATIENCE_NS))),
            (_, None) => TimeBudget::new(budget_ns),
            (_, Some(_)) => TimeBudget::default(),
        };
        let sampled = SampledLoop { period_s: config.period_ns as f64 * 1.0e-9, latency_s: model.latency_s };
        Ok((Layer::new(instances, &model.blend, budget, &sampled), values, estimates))
    }

    /// Creates one instance: in the loop, in a worker, or asynchronous.
    fn engine(&self, budget_ns: Option<u64>, progress: &Progress) -> Result<Engine, RunError> {
        let Self { isolation, plugin, settings, model, config, clock } = self;
        let no = |refusal| refused(plugin.metadata(), refusal);
        progress.enter(&model.name, Call::Create);
        let mut engine = match isolation {
            Isolation::Process => {
                let keys = model.plugin.parameters.iter().map(|parameter| parameter.key.clone());
                let values = settings.iter().map(|setting| setting.display());
                let in_the_loop = model.field.is_none().then_some(budget_ns).flatten();
                let worker_config = WorkerConfig {
                    plugin: &plugin.metadata().path,
                    sets: keys.zip(values).collect(),
                    config: model
                        .field
                        .as_ref()
                        .map_or(*config, |field| AsynchronousModel::config(field, config)),
                    // The loop does not wait for a field.
                    timeout_ns: in_the_loop.unwrap_or(PATIENCE_NS),
                    create_timeout: limit(),
                };
                Engine::Process(Worker::start(&worker_config).map_err(no)?)
            }
            Isolation::ByOrigin | Isolation::None => Engine::Here(plugin.create_model(settings)?),
        };
        let Some(timing) = &model.field else {
            progress.enter(&model.name, Call::Prepare);
            engine.prepare(config).map_err(no)?;
            return Ok(engine);
        };
        if !engine.has_linear_field() {
            let problem =
                "the plugin has no local linear model; remove `[model.field]` to run it in the loop";
            return Err(complain(model, problem).into());
        }
        progress.enter(&model.name, Call::Prepare);
        let slow = AsynchronousModel::start(engine, plugin.parameters().len(), timing, config, *clock);
        Ok(Engine::Asynchronous(Box::new(slow.map_err(no)?)))
    }
}

/// Builds a scene error located at the model.
fn complain(model: &ModelUse, problem: &str) -> SceneError {
    model.plugin.location.problem(format!("[{}] {problem}", model.name))
}

/// Timeout of a worker on the virtual clock, ns.
const PATIENCE_NS: u64 = 2_000_000_000;

/// Returns the time limit of a step of a model, ns. On the virtual clock only if the scene sets one: the wall clock would make two
/// runs differ.
fn budget_ns(model: &ModelUse, clock: Clock, period_ns: u64) -> Option<u64> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked: at most a second
    let told_ns = model.budget_s.map(|seconds| (seconds * 1.0e9).round() as u64);
    let usual_ns = match clock {
        Clock::Real => Some(period_ns / 2),
        Clock::Virtual => None,
    };
    told_ns.or(usual_ns)
}

/// Checks settings against the plugin's schema; errors name file and line.
pub(super) fn settings(
    plugin: &Plugin,
    name: &str,
    parameters: &[ParameterText],
) -> Result<Vec<Setting>, SceneError> {
    let schema = plugin.parameters();
    let check = |parameter: &ParameterText| {
        let value = from_the_scene(schema, parameter);
        Setting::parse(schema, &parameter.key, &value)
            .map_err(|error| parameter.location.problem(format!("[{name}] {error}")))
    };
    parameters.iter().map(check).collect()
}

/// Returns the value for the plugin: a file is relative to the scene that names it, or to the working folder on a command line.
fn from_the_scene<'t>(schema: &[Parameter], text: &'t ParameterText) -> Cow<'t, str> {
    let ParameterText { key, value, location } = text;
    let parameter = schema.iter().find(|parameter| parameter.id() == key);
    let is_file = parameter.is_some_and(|parameter| {
        let built_in = parameter.choices().iter().any(|name| name.as_str() == value);
        parameter.kind() == ParameterKind::File && !built_in && !value.is_empty()
    });
    match location.file.parent() {
        Some(folder) if is_file && location.is_in_a_file() => {
            Cow::Owned(folder.join(value).to_string_lossy().into_owned())
        }
        _ => Cow::Borrowed(value),
    }
}

/// Creates a report on a plugin with these settings; `value` reads a parameter of the plugin.
fn report(
    plugin: &Plugin,
    name: &str,
    used: &PluginUse,
    settings: &[Setting],
    value: impl FnMut(usize) -> f64,
) -> PluginReport {
    let written = used.parameters.iter().map(|parameter| (parameter.key.clone(), parameter.value.clone()));
    let parameters = in_force(plugin, settings, value);
    PluginReport {
        name: name.to_owned(),
        metadata: plugin.metadata().clone(),
        schema: plugin.parameters(),
        settings: written.collect(),
        soft_ranges: soft_ranges(plugin, &parameters),
        embodiment: plugin.device_info().map(|info| info.embodiment()),
        parameters,
        latency_s: 0.0,
        at_hand: Demand::WRENCH,
        isolation: None,
        signals_taken: TakenSignals::default(),
        estimates: Vec::new(),
    }
}

/// Returns the range of each parameter for changes by hand, at its present value. No hand is on a simulated device: its numbers
/// change at once.
fn soft_ranges(plugin: &Plugin, values: &[(String, String)]) -> Vec<Option<SoftRange>> {
    if plugin.device_info().is_some_and(|info| info.embodiment() == Embodiment::Simulated) {
        return vec![None; values.len()];
    }
    let number = |(_, value): &(String, String)| value.parse().unwrap_or(f64::NAN);
    values.iter().map(number).enumerate().map(|(index, value)| plugin.soft_range(index, value)).collect()
}

/// Returns every parameter with its value, as text.
pub(super) fn in_force(
    plugin: &Plugin,
    settings: &[Setting],
    mut value: impl FnMut(usize) -> f64,
) -> Vec<(String, String)> {
    let schema = plugin.parameters();
    let show = |(index, parameter): (usize, &Parameter)| {
        let text = match parameter.kind() {
            // Plugins return numbers only: a text has its value if it was set.
            ParameterKind::Text | ParameterKind::File => {
                let set = settings.iter().rev().find(|setting| setting.index() == index);
                set.map_or_else(String::new, |setting| setting.display())
            }
            ParameterKind::Real | ParameterKind::Choice => {
                let setting = Setting::number(schema, parameter.id(), value(index));
                setting.map_or_else(|_| String::new(), |setting| setting.display())
            }
        };
        (parameter.id().to_owned(), text)
    };
    schema.iter().enumerate().map(show).collect()
}

/// Returns all mismatches of a scene with its device `number`, before anything is energised.
pub(super) fn pair(scene: &Scene, number: u16, device: &Capabilities, can_pace: bool) -> Vec<String> {
    let mut mismatches = Vec::new();
    let [slowest, fastest] = device.rate_hz;
    if scene.rate_hz < slowest || scene.rate_hz > fastest {
        mismatches.push(format!(
            "rate {} Hz, but the device runs at {slowest} to {fastest} Hz; change `rate_hz`",
            scene.rate_hz
        ));
    }
    // Only the first device can set the pace.
    if scene.pacing == Pacing::Device && number == 0 && !can_pace {
        mismatches.push(
            "the device cannot set the pace of the loop; remove `pacing`, or set `pacing = \"host\"`"
                .to_owned(),
        );
    }
    mismatches.extend(boundless(&scene.boundary, device));
    let is_felt = scene.models.iter().any(|model| model.device == number)
        || scene.couplings.iter().any(|coupling| coupling.ends.here().iter().any(|end| end.device == number));
    if is_felt {
        mismatches.extend(unfelt(&scene.limits.force_n.axes(), device));
    }
    mismatches
}

/// Returns an error text if the boundary's margin leaves no free workspace, but only a spring to the centre.
fn boundless(boundary: &Boundary, device: &Capabilities) -> Option<String> {
    let narrowest = |range: [f64; 3]| {
        let moving = range.into_iter().filter(|half_side| *half_side > 0.0);
        moving.fold(f64::INFINITY, f64::min)
    };
    let (range_m, range_rad) = (narrowest(device.range_m), narrowest(device.range_rad));
    let says = |key, margin: f64, range: f64, unit| {
        format!(
            "`{key} = {margin:.3}` leaves no free workspace, because the device moves {range:.3} {unit} around home; reduce `{key}`"
        )
    };
    if boundary.margin_m >= range_m {
        return Some(says("margin_mm", boundary.margin_m * 1.0e3, range_m * 1.0e3, "mm"));
    }
    let (margin_deg, range_deg) = (boundary.margin_rad.to_degrees(), range_rad.to_degrees());
    (margin_deg >= range_deg).then(|| says("margin_deg", margin_deg, range_deg, "degrees"))
}

/// Returns an error text if models may request a force that the device lacks, unless the scene wants none there.
fn unfelt(wanted_n: &[f64; 3], device: &Capabilities) -> Option<String> {
    let axes = [(Axes::X, "x"), (Axes::Y, "y"), (Axes::Z, "z")];
    let is_driven = axes.map(|(axis, _)| device.actuated.contains(axis));
    let is_unfelt =
        |index: usize| !is_driven[index] && wanted_n.get(index).is_some_and(|most_n| *most_n > 0.0);
    let unfelt: Vec<&str> = (0..3).filter(|index| is_unfelt(*index)).map(|index| axes[index].1).collect();
    if unfelt.is_empty() {
        return None;
    }
    let accepted: Vec<String> = device
        .max_force_n
        .iter()
        .zip(is_driven)
        .map(|(most_n, is_driven)| if is_driven { most_n.to_string() } else { "0".to_owned() })
        .collect();
    let accepted = accepted.join(", ");
    Some(if is_driven == [false; 3] {
        format!(
            "the device exerts no force, so the hand cannot feel a model; set `[limits] force_n = [{accepted}]` to \
             accept this: the host then computes, shows and records the models. A scene without a `[[model]]` \
             records poses"
        )
    } else {
        format!(
            "the device exerts no force along {}, so the hand cannot feel this component of a model's force; set \
             `[limits] force_n = [{accepted}]` to accept this",
            unfelt.join(" and ")
        )
    })
}

/// Scheduled changes and replacements of a scene, checked and created.
pub(super) struct Scheduled {
    pub(super) changes: Vec<ScheduledChange>,
    pub(super) replacements: Vec<(u64, Replacement)>,
}

/// Checks the scheduled changes of a scene and creates the models for replacements; errors name file and line.
pub(super) fn schedule(
    scene: &Scene,
    plugins: &PluginTable,
    registry: &Registry,
    config: &LoopConfig,
    clock: Clock,
) -> Result<Scheduled, RunError> {
    let mut in_time: Vec<&ChangeUse> = scene.changes.iter().collect();
    in_time.sort_by(|a, b| a.at_s.total_cmp(&b.at_s)); // stable: a change is checked against the plugins of its time
    let mut scheduled = Scheduled { changes: Vec::new(), replacements: Vec::new() };
    // Alternatives not drawn by this seed, per model.
    let mut passed_over = vec![Vec::new(); scene.models.len()];
    for (draw, change) in (0..).zip(in_time) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
        let time_ns = (change.at_s * 1.0e9).round() as u64;
        let complain = |key: &str, error: ControlError| change.location.problem(format!("`{key}`: {error}"));
        let checked = match &change.what {
            ChangeWhat::Set { plugin, parameter: ParameterText { key, value, .. } } => {
                let new = NewValue { plugin, parameter: key, value };
                match plugins.check(&new) {
                    Ok(checked) => checked,
                    // The change is for another seed.
                    Err(_) if passed_over.iter().flatten().any(|part| understands(part, &new)) => continue,
                    Err(error) => return Err(complain("change.set", error).into()),
                }
            }
            ChangeWhat::Weight { model, weight } => {
                plugins.check_weight(model, *weight).map_err(|error| complain("change.weight", error))?
            }
            ChangeWhat::Swap { model, by } => {
                let choice = chosen(config.seed, draw, by.len());
                for number in plugins.models(model).map_err(|error| complain("change.swap", error))? {
                    let Some(place) = scene.models.get(number) else { continue };
                    let make = |Alternative { plugin, parameters }: &Alternative| {
                        let mut other = place.replaced_by(plugin.as_deref(), &[]);
                        other.plugin.location = change.location.clone();
                        other.plugin.parameters.extend(parameters.iter().cloned());
                        prepare_model(registry, &other, config, clock)
                    };
                    // All of them: an error in one is found with any seed.
                    let mut made = by.iter().map(make).collect::<Result<Vec<_>, _>>()?;
                    if choice >= made.len() {
                        continue;
                    }
                    let (layer, report) = made.swap_remove(choice);
                    if let Some(others) = passed_over.get_mut(number) {
                        *others = made.into_iter().map(|(_, report)| report).collect();
                    }
                    let chosen_by = if by.len() > 1 { ChosenBy::Seed } else { ChosenBy::Name };
                    let generation = plugins.add(number, report, chosen_by);
                    let model = u32::try_from(number).unwrap_or(u32::MAX); // a scene has fewer models
                    let replacement = Replacement { model, generation, layer: Box::new(layer) };
                    scheduled.replacements.push((time_ns, replacement));
                }
                continue;
            }
        };
        scheduled.changes.extend(checked.into_iter().map(|change| ScheduledChange { time_ns, change }));
    }
    plugins.start_with_the_first();
    Ok(scheduled)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVICE: Capabilities = Capabilities {
        sensed: Axes::ALL,
        actuated: Axes::ALL,
        range_m: [0.01, 0.01, 0.0],
        range_rad: [0.1; 3],
        resolution_m: 0.0,
        max_force_n: [3.0; 3],
        max_torque_nm: [0.0; 3],
        max_force_slew_n_per_s: f64::INFINITY,
        max_torque_slew_nm_per_s: f64::INFINITY,
        max_stiffness_n_per_m: 0.0,
        rate_hz: [100.0, 10_000.0],
        latency_s: 0.0,
    };

    fn mismatch(wanted_n: [f64; 3], actuated: Axes, max_force_n: [f64; 3]) -> Option<String> {
        unfelt(&wanted_n, &Capabilities { actuated, max_force_n, ..DEVICE })
    }

    #[test]
    fn a_boundary_that_leaves_no_room_is_refused() {
        let said = |boundary: Boundary| boundless(&boundary, &DEVICE);
        assert_eq!(said(Boundary::default()), None); // an axis that does not move needs no room
        let wide = said(Boundary { margin_m: 0.01, ..Boundary::default() }).expect("10 of 10 mm");
        assert!(wide.contains("`margin_mm = 10.000`"), "{wide}");
        let turned = said(Boundary { margin_rad: 0.2, ..Boundary::default() }).expect("0.2 of 0.1 rad");
        assert!(turned.contains("`margin_deg = 11.459`"), "{turned}");
    }

    #[test]
    fn a_device_without_force_says_what_works_and_takes_its_word() {
        let said = mismatch([f64::INFINITY; 3], Axes::NONE, [0.0; 3]).expect("nothing could be felt");
        assert!(said.contains("exerts no force") && said.contains("force_n = [0, 0, 0]"), "{said}");
        assert_eq!(mismatch([0.0; 3], Axes::NONE, [0.0; 3]), None);
        assert_eq!(mismatch([f64::INFINITY; 3], Axes::ALL, [3.0; 3]), None);
    }

    #[test]
    fn a_planar_device_says_which_axis_is_missing_and_takes_its_word() {
        let said = mismatch([f64::INFINITY; 3], Axes::PLANE, [3.0, 3.0, 0.0]).expect("z would not be felt");
        assert!(said.contains("along z") && said.contains("force_n = [3, 3, 0]"), "{said}");
        assert_eq!(mismatch([3.0, 3.0, 0.0], Axes::PLANE, [3.0, 3.0, 0.0]), None);
    }
}
