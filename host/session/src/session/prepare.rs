//! Devices and models of a scene: loads their plugins, checks their settings, opens the devices and creates the models.

use super::{PluginReport, RunError, StopWithoutHost};
use crate::calibration_file::{CalibrationFile, CalibrationFileError};
use crate::calls::{Call, CallThread, Progress, is_to_begin, keeping_machine, limit};
use crate::registry::{LookupError, Registry, is_installed};
use crate::scene::{
    CalibrationUse, DeviceUse, Isolation, ModelUse, ParameterText, PluginUse, Scene, SceneError,
};
use flotor_core::demand::hand_demand;
use flotor_core::end_wall::pushes_at_home;
use flotor_core::limits::Bound;
use flotor_core::mapping::Mapping;
use flotor_core::to_ns;
use flotor_hal::abi::PluginKind;
use flotor_hal::{
    Capabilities, DVec3, Demand, Embodiment, GripAxis, LoopConfig, Parameter, ParameterKind, SampledLoop,
    SoftRange,
};
use flotor_loader::{Metadata, OpenedDevice, Plugin, Setting};
use flotor_servo::engine::asynchronous::AsynchronousModel;
use flotor_servo::engine::process::{Worker, WorkerConfig};
use flotor_servo::last_stop::{SignalGuard, TakenSignals};
use flotor_servo::{Clock, Engine, Layer, TimeBudget};
use std::borrow::Cow;
use std::time::Duration;

fn load(registry: &Registry, plugin: &PluginUse, kind: PluginKind) -> Result<Plugin, RunError> {
    registry.load(&plugin.plugin, kind).map_err(|error| not_found(plugin, error))
}

/// Checks that the plugins of a scene exist, and the settings of the plugins of this installation, whose files it loads. Runs no code of
/// other plugins. Not real-time.
///
/// # Errors
/// [`RunError`] for the first plugin that is unknown, of the wrong kind or unreadable, or for the first wrong setting, with the line
/// of the scene.
pub fn check_plugins(scene: &Scene, registry: &Registry) -> Result<(), RunError> {
    let devices = scene.devices.iter().map(|device| (&device.name, &device.plugin, PluginKind::Device));
    let models = scene.models.iter().map(|model| (&model.name, &model.plugin, PluginKind::Model));
    devices.chain(models).try_for_each(|(name, used, kind)| {
        registry.check(&used.plugin, kind).map_err(|error| not_found(used, error))?;
        if registry.file(&used.plugin).is_ok_and(|file| is_installed(&file)) {
            settings(&load(registry, used, kind)?, name, &used.parameters)?;
        }
        Ok(())
    })
}

fn not_found(plugin: &PluginUse, error: LookupError) -> RunError {
    match RunError::from(error) {
        wrong if wrong.is_configuration() => plugin.location.problem(wrong.to_string()).into(),
        refused => refused,
    }
}

/// Loads a calibration file, checks that it was made for this device, and passes the calibration to the device. Not real-time.
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
    device.calibrate_vertical(&curve).map_err(|refusal| RunError::refused(plugin.metadata(), refusal))
}

/// Open device, not energised, with its capabilities.
pub(super) struct Opened {
    pub(super) device: OpenedDevice,
    pub(super) capabilities: Capabilities,
    /// Declared grip; `None` without one.
    pub(super) grip: Option<GripAxis>,
    pub(super) embodiment: Embodiment,
    /// Means that stop the device after the end of this process.
    pub(super) stop: StopWithoutHost,
}

/// Loads the device plugins of a scene and opens the devices. Not real-time.
pub(super) fn open_devices(
    registry: &Registry,
    scene: &Scene,
) -> Result<(Vec<Opened>, Vec<PluginReport>), RunError> {
    let open = |device| {
        let (opened, mut report) = open_device(registry, device)?;
        let most_torque_nm = Bound::box_of(opened.capabilities.max_torque_nm);
        report.at_hand = hand_demand(&scene.limits.torque_nm.and(most_torque_nm));
        Ok((opened, report))
    };
    scene.devices.iter().map(open).collect()
}

fn open_device(registry: &Registry, device: &DeviceUse) -> Result<(Opened, PluginReport), RunError> {
    let DeviceUse { name, plugin: used, calibration, .. } = device;
    let signals = SignalGuard::take();
    let plugin = load(registry, used, PluginKind::Device)?;
    let settings = settings(&plugin, name, &used.parameters)?;
    let (who, opening, given) = (name.clone(), plugin.clone(), settings.clone());
    let embodiment = plugin.device_info().map_or(Embodiment::Physical, |info| info.embodiment());
    let open = move |progress: &Progress| {
        progress.enter(&who, Call::Open);
        let refuse = |refusal| RunError::refused(opening.metadata(), refusal);
        let mut device = opening.open_device(&given)?;
        let capabilities = device.capabilities().map_err(refuse)?;
        let grip = device.grip_axis().map_err(refuse)?;
        let stop = StopWithoutHost::of(&who, embodiment, &capabilities, &mut device).map_err(refuse)?;
        let values: Vec<f64> = (0..opening.parameters().len()).map(|index| device.parameter(index)).collect();
        Ok::<_, RunError>((device, capabilities, grip, stop, values))
    };
    let (mut device, capabilities, grip, stop, values) =
        keeping_machine(name, || CallThread::default().run_while(limit(), is_to_begin, open))??;
    let mut report = report(&plugin, name, used, &settings, &values);
    if let Some(calibration) = calibration {
        calibrate(&plugin, &mut device, calibration)?;
    }
    report.signals_taken = signals.put_back();
    report.latency_s = capabilities.latency_s;
    Ok((Opened { device, capabilities, grip, embodiment, stop }, report))
}

/// Loads the plugin of a model and creates an instance at each of the model's positions. Not real-time; runs the plugin's code.
///
/// # Errors
/// [`RunError`]: the plugin is unknown or was rejected, refused its settings, did not return, or does not fit the model's table in
/// the scene.
pub fn prepare_model(
    registry: &Registry,
    model: &ModelUse,
    config: &LoopConfig,
    clock: Clock,
) -> Result<(Layer, PluginReport), RunError> {
    prepare_model_while(registry, model, config, clock, is_to_begin)
}

/// Prepares a model as [`prepare_model`] does, but waits only while `is_wanted` returns true.
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
    let (layer, values, estimates) =
        keeping_machine(&model.name, || CallThread::default().run_while(most, is_wanted, make))??;
    let mut report = report(&plugin, &model.name, &model.plugin, &settings, &values);
    report.signals_taken = signals.put_back();
    report.estimates = estimates;
    report.isolation = Some(isolation);
    report.field = model.field;
    Ok((layer, report))
}

/// Returns the scene with the latencies of its open devices, and without isolation by origin where no hand is at risk: on the virtual
/// clock and on simulated devices.
pub(super) fn settled(scene: &Scene, opened: &[Opened], clock: Clock) -> Scene {
    let mut scene = scene.clone();
    let period_s = 1.0 / scene.rate_hz;
    for model in &mut scene.models {
        let on = model.devices();
        let devices = || on.iter().filter_map(|number| opened.get(*number));
        let is_simulated = devices().all(|device| device.embodiment == Embodiment::Simulated);
        if model.isolation == Isolation::ByOrigin && (clock == Clock::Virtual || is_simulated) {
            model.isolation = Isolation::None;
        }
        model.latency_s = devices().map(|device| device.capabilities.latency_s).fold(0.0, f64::max);
        let Some(field) = &mut model.field else { continue };
        let limits = field.contacts;
        let contacts_on = |device: u16| {
            let (used, opened) = (scene.devices.get(usize::from(device))?, opened.get(usize::from(device))?);
            Some(limits.on(&opened.capabilities, used.damping_ns_per_m, &scene.limits, period_s))
        };
        model.shared_with.iter_mut().for_each(|port| port.contacts = contacts_on(port.device));
        field.contacts = contacts_on(model.device).unwrap_or(limits);
    }
    scene
}

/// Layers of a scene's models, each with its device numbers, and reports on their plugins.
type Models = (Vec<(Vec<usize>, Layer)>, Vec<PluginReport>);

/// Loads the models of a scene and creates an instance at each position of each model. Not real-time.
pub(super) fn prepare_models(
    registry: &Registry,
    scene: &Scene,
    config: &LoopConfig,
    clock: Clock,
) -> Result<Models, RunError> {
    let prepare = |model: &ModelUse| {
        let (layer, report) = prepare_model(registry, model, config, clock)?;
        Ok(((model.devices(), layer), report))
    };
    scene.models.iter().map(prepare).collect()
}

/// Additional time for ending a worker whose model was not created in time.
const END_OF_A_WORKER: Duration = Duration::from_secs(10);

/// Largest number of instances of a model that get a process each without the scene's explicit request.
const MAX_PROCESSES: usize = 64;

/// Resolves the isolation of a model by its origin; returns an error if too many instances would need a process each.
fn isolation(model: &ModelUse, plugin: &Metadata, clock: Clock) -> Result<Isolation, SceneError> {
    let is_outside = clock == Clock::Real && !is_installed(&plugin.path);
    match model.isolation {
        Isolation::ByOrigin if is_outside && model.places_m.len() > MAX_PROCESSES => {
            let objects = model.places_m.len();
            let problem = format!(
                "the plugin is not part of the installation, so each of its {objects} objects would get a \
                 worker process, more than the limit of {MAX_PROCESSES}; set `isolation = \"process\"` to \
                 start all of them, or `isolation = \"none\"` to run the model in the host process"
            );
            Err(complain(model, &problem))
        }
        Isolation::ByOrigin if is_outside && !model.shared_with.is_empty() => {
            let problem = "the plugin is not part of the installation, so it would get a worker process, which devices cannot \
                           share; set `isolation = \"none\"` to run it in the host process, or remove `shared`";
            Err(complain(model, problem))
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
    /// Creates an instance of the model at each of its positions; returns the layer with the model's parameter values and error
    /// estimates. Runs the plugin's code.
    fn layer(&self, progress: &Progress) -> Result<(Layer, Vec<f64>, Estimates), RunError> {
        let Self { plugin, model, config, clock, .. } = self;
        let budget_ns = budget_ns(model, *clock, config.period_ns);
        let mapping = Mapping::new(&model.mapping);
        let further = model.shared_with.iter().map(|port| Mapping::new(&port.mapping).at(port.place_m));
        let further: Vec<Mapping> = further.collect();
        let instance = |place_m: &[f64; 3]| {
            let mapping = mapping.at(*place_m);
            let mut engine = self.engine((&mapping, &further), budget_ns, progress)?;
            let bounds = engine.workspace_bounds();
            let mut mappings = std::iter::once(&mapping).chain(&further);
            if let Some(excluded) = mappings.find(|mapping| pushes_at_home(&bounds, mapping)) {
                let problem = format!(
                    "at {} mm the workspace limits of the model exclude the home of its device, and the wall at these \
                     limits would push there; move the model (`position_mm`) or choose parameters that extend its limits",
                    excluded.position_to_device(DVec3::ZERO) * 1.0e3
                );
                return Err(complain(model, &problem).into());
            }
            Ok((engine, mapping))
        };
        let mut instances = model.places_m.iter().map(instance).collect::<Result<Vec<_>, RunError>>()?;
        let mut value = |index| instances.first_mut().map_or(f64::NAN, |(first, _)| first.parameter(index));
        let values = (0..plugin.parameters().len()).map(&mut value).collect();
        let estimates = match instances.first_mut() {
            Some((Engine::Here(model), _)) => model.estimates(),
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
        let layer = match instances.pop() {
            Some(one) if !further.is_empty() => Layer::shared(one, further, &model.blend, budget, &sampled),
            last => Layer::new(instances.into_iter().chain(last).collect(), &model.blend, budget, &sampled),
        };
        Ok((layer, values, estimates))
    }

    /// Creates and prepares one instance: in the loop, in a worker, or asynchronous, for its port and the `further` ones.
    fn engine(
        &self,
        (mapping, further): (&Mapping, &[Mapping]),
        budget_ns: Option<u64>,
        progress: &Progress,
    ) -> Result<Engine, RunError> {
        let Self { isolation, plugin, settings, model, config, clock } = self;
        let no = |refusal| RunError::refused(plugin.metadata(), refusal);
        progress.enter(&model.name, Call::Create);
        let mut engine = match isolation {
            Isolation::Process => {
                let keys = model.plugin.parameters.iter().map(|parameter| parameter.key.clone());
                let values = settings.iter().map(|setting| setting.display());
                let field = model.field.as_ref();
                let in_the_loop = budget_ns.filter(|_| field.is_none());
                let worker_config = WorkerConfig {
                    plugin: &plugin.metadata().path,
                    sets: keys.zip(values).collect(),
                    config: field.map_or(*config, |field| AsynchronousModel::config(field, config)),
                    // The loop does not wait for an asynchronous model.
                    timeout_ns: in_the_loop.unwrap_or(PATIENCE_NS),
                    create_timeout: limit(),
                };
                Engine::Process(Worker::start(&worker_config).map_err(no)?)
            }
            Isolation::ByOrigin | Isolation::None => Engine::Here(plugin.create_model(settings)?),
        };
        let (can_share, lacks) = match model.field {
            None => (engine.has_ports(), "flotor.world/1"),
            Some(_) => (engine.has_world_contacts(), "flotor.world-contacts/1"),
        };
        if !model.shared_with.is_empty() && !can_share {
            let problem = format!(
                "the plugin cannot be shared: it does not offer `{lacks}`; remove `shared` to give each device an instance of \
                 its own"
            );
            return Err(complain(model, &problem).into());
        }
        let Some(timing) = &model.field else {
            progress.enter(&model.name, Call::Prepare);
            engine.prepare(config).map_err(no)?;
            return Ok(engine);
        };
        if !engine.has_local_model() {
            let problem = "the plugin has no contacts and no local linear model; remove `[model.field]` to run it in the loop";
            return Err(complain(model, problem).into());
        }
        progress.enter(&model.name, Call::Prepare);
        let parameters = plugin.parameters().len();
        let limits = model.shared_with.iter().map(|port| port.contacts.as_ref().unwrap_or(&timing.contacts));
        let ports: Vec<_> =
            std::iter::once((mapping, &timing.contacts)).chain(further.iter().zip(limits)).collect();
        let slow = AsynchronousModel::start(engine, parameters, (timing, &ports), config, *clock);
        Ok(Engine::Asynchronous(Box::new(slow.map_err(no)?)))
    }
}

/// Builds a scene error located at the model.
fn complain(model: &ModelUse, problem: &str) -> SceneError {
    model.plugin.location.problem(format!("[{}] {problem}", model.name))
}

/// Timeout of a worker without a time limit for its steps (virtual clock, asynchronous model), ns.
const PATIENCE_NS: u64 = 2_000_000_000;

/// Returns the time limit of a step of a model, ns; `None` on the virtual clock unless the scene sets a limit: a limit on wall-clock
/// time would make two runs differ.
fn budget_ns(model: &ModelUse, clock: Clock, period_ns: u64) -> Option<u64> {
    model.budget_s.map(to_ns).or((clock == Clock::Real).then_some(period_ns / 2))
}

/// Parses settings and checks them against the plugin's schema; errors name file and line.
fn settings(plugin: &Plugin, name: &str, parameters: &[ParameterText]) -> Result<Vec<Setting>, SceneError> {
    let schema = plugin.parameters();
    let check = |parameter: &ParameterText| {
        let value = from_the_scene(schema, parameter);
        Setting::parse(schema, &parameter.key, &value)
            .map_err(|error| parameter.location.problem(format!("[{name}] {error}")))
    };
    parameters.iter().map(check).collect()
}

/// Returns the value for the plugin. A file named in a scene is resolved against the folder of the scene file; a file on the command
/// line stays relative to the working directory.
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

/// Creates a report on a plugin with these settings and the values of its parameters.
fn report(
    plugin: &Plugin,
    name: &str,
    used: &PluginUse,
    settings: &[Setting],
    values: &[f64],
) -> PluginReport {
    let written = used.parameters.iter().map(|parameter| (parameter.key.clone(), parameter.value.clone()));
    let parameters = in_force(plugin, settings, values);
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
        field: None,
        signals_taken: TakenSignals::default(),
        estimates: Vec::new(),
    }
}

/// Returns the soft range of each parameter at its current value; `None` for all parameters of a simulated device, which change at
/// once because no hand is on the device.
fn soft_ranges(plugin: &Plugin, values: &[(String, String)]) -> Vec<Option<SoftRange>> {
    if plugin.device_info().is_some_and(|info| info.embodiment() == Embodiment::Simulated) {
        return vec![None; values.len()];
    }
    let number = |(_, value): &(String, String)| value.parse().unwrap_or(f64::NAN);
    values.iter().map(number).enumerate().map(|(index, value)| plugin.soft_range(index, value)).collect()
}

/// Returns the id of every parameter with its current value, as text.
fn in_force(plugin: &Plugin, settings: &[Setting], values: &[f64]) -> Vec<(String, String)> {
    let schema = plugin.parameters();
    let show = |(index, parameter): (usize, &Parameter)| {
        let text = match parameter.kind() {
            // Plugins return numbers only: a text has its value if it was set.
            ParameterKind::Text | ParameterKind::File => {
                let set = settings.iter().rev().find(|setting| setting.index() == index);
                set.map_or_else(String::new, |setting| setting.display())
            }
            ParameterKind::Real | ParameterKind::Choice => {
                let value = values.get(index).copied().unwrap_or(f64::NAN);
                let setting = Setting::number(schema, parameter.id(), value);
                setting.map_or_else(|_| String::new(), |setting| setting.display())
            }
        };
        (parameter.id().to_owned(), text)
    };
    schema.iter().enumerate().map(show).collect()
}
