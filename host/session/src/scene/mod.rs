//! Scene: devices, models, their mapping and limits, read from a TOML file; unknown keys are errors.

mod change;
mod coupling;
mod devices;
mod own;
mod placement;
mod reader;
mod reference;
mod setting;
mod shared;

pub use change::{Alternative, ChangeUse, ChangeWhat};
pub use devices::DeviceUse;
pub use devices::{is_named, without_device};
use flotor_core::asynchronous::{ContactLimits, FieldTiming, StiffnessCap};
use flotor_core::coupling::CouplingDescription;
use flotor_core::limits::PassivityMode;
use flotor_core::limits::{Boundary, Limits};
use flotor_core::mapping::{Blend, MappingConfig, PortConfig};
use flotor_core::plausibility::is_rotation;
pub use own::{OWN_SCENES, OwnScene};
pub use reader::{Location, ParameterText, SceneError};
pub use reference::{KeyReference, SectionReference, reference};
pub use setting::{KeyValue, PluginKeyValue};

use flotor_hal::{DQuat, TextProblem, read_text};
use reader::{Section, Source, Value};
pub use reader::{did_you_mean, nearest};
use std::path::{Path, PathBuf};

/// Scene that `flotor` runs if none is named: spring 1 on the simulated flotor, held by a hand.
pub const DEMO: &str = include_str!("../../scenes/demo.toml");

/// Scene of perception experiments: a spring for the subject to judge, on the simulated flotor.
pub const STUDY: &str = include_str!("../../scenes/study.toml");

/// Scene as read from text: complete and consistent, but not yet checked against the named plugins.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Title of the run in reports; may be empty.
    pub title: String,
    /// TOML text of the scene, stored in recordings.
    pub text: String,
    /// Loop rate, Hz.
    pub rate_hz: f64,
    /// Time base of the ticks, on the real clock only.
    pub pacing: Pacing,
    /// Duration of the run, s.
    pub duration_s: f64,
    /// Plugin folders, searched before all other folders; [`Scene::load`] resolves relative paths against the folder of the scene
    /// file.
    pub plugin_folders: Vec<PathBuf>,
    /// Devices, at least one.
    pub devices: Vec<DeviceUse>,
    /// Force models, whose wrenches add up. A model on several devices has an entry for each, unless the devices share it.
    pub models: Vec<ModelUse>,
    /// Virtual couplings between two devices, or with a device on another host.
    pub couplings: Vec<CouplingDescription>,
    /// Limits of the scene for every device; where the device declares a tighter limit, that limit applies.
    pub limits: Limits,
    /// Spring-damper wall a little inside the range of each device.
    pub boundary: Boundary,
    /// Scheduled changes, in the order of the file.
    pub changes: Vec<ChangeUse>,
}

/// Plugin named in a scene, with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct PluginUse {
    /// Id of the plugin, or path of its file.
    pub plugin: String,
    /// Location of the id, for error messages.
    pub location: Location,
    /// Parameters as written, checked later against the plugin's schema.
    pub parameters: Vec<ParameterText>,
}

/// Calibration file named in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationUse {
    /// Path as written in the scene; [`Self::path`] resolves a relative path.
    pub file: PathBuf,
    /// Location of the path in the scene.
    pub location: Location,
}

impl CalibrationUse {
    /// Resolves the path against the folder of the scene file, if the scene comes from a file. The result is absolute or relative to
    /// the working directory of this process.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        match self.location.file.parent() {
            Some(folder) if self.location.is_in_a_file() => folder.join(&self.file),
            _ => self.file.clone(),
        }
    }
}

/// Force model of a scene on one device, or shared by several.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelUse {
    /// Name in `--set NAME.KEY=VALUE` and reports; the plugin's id by default.
    pub name: String,
    /// Plugin of the model.
    pub plugin: PluginUse,
    /// Number of the model's device, from 0 in the scene's order; of a shared model, of the first.
    pub device: u16,
    /// Mapping between device frame and model frame: rotation and scales.
    pub mapping: MappingConfig,
    /// Positions of the model's home in the device frame, m; one instance for each.
    pub places_m: Vec<[f64; 3]>,
    /// Ports at the further devices of a shared model, whose one instance is at its only position; empty for other models.
    pub shared_with: Vec<PortConfig>,
    /// Weight, priority and fade time of the model among the models of its device.
    pub blend: Blend,
    /// Isolation of the model from the host process.
    pub isolation: Isolation,
    /// Timing of an asynchronous model, whose contacts or local linear model the loop evaluates; `None`: the loop steps the model.
    pub field: Option<FieldTiming>,
    /// Time limit of a step, s; `None`: half a period on the real clock, no limit on the virtual clock.
    pub budget_s: Option<f64>,
    /// Latency declared by the model's device, s; 0 until a session has opened the device.
    pub latency_s: f64,
}

/// Isolation of a model from the host process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Isolation {
    /// By the model's origin: a worker process if the plugin is from outside the installation, the device physical and the clock
    /// real; otherwise none.
    #[default]
    ByOrigin,
    /// No isolation: the model runs in the loop's own thread.
    None,
    /// Worker process: a hang or crash of the model ends neither loop nor host.
    Process,
}

impl Isolation {
    /// Returns the value of the key `isolation` in a scene, "process" or "none"; `ByOrigin`, which has no value in scenes, gives
    /// "none".
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::None | Self::ByOrigin => "none",
        }
    }
}

impl ModelUse {
    /// Returns the numbers of the model's devices: one, or those of the ports of a shared model.
    #[must_use]
    pub fn devices(&self) -> Vec<usize> {
        let further = self.shared_with.iter().map(|port| port.device);
        std::iter::once(self.device).chain(further).map(usize::from).collect()
    }

    /// Returns a copy of the model with `plugin`, or with the same plugin for `None`. A given plugin starts from its own defaults,
    /// without the parameters of the scene; `settings`, as key and value, are added.
    #[must_use]
    pub fn replaced_by(&self, plugin: Option<&str>, settings: &[(&str, &str)]) -> Self {
        let mut other = self.clone();
        if let Some(plugin) = plugin {
            plugin.clone_into(&mut other.plugin.plugin);
            other.plugin.parameters.clear();
        }
        other.plugin.parameters.extend(settings.iter().map(|(key, value)| ParameterText {
            key: (*key).to_owned(),
            value: (*value).to_owned(),
            location: Location { file: PathBuf::from(format!("--set {key}")), line: 0 },
        }));
        other
    }
}

impl Scene {
    /// Default of `duration_s`, s.
    pub const DURATION_S: f64 = 10.0;

    /// Reads the built-in demo.
    ///
    /// # Errors
    /// Never in practice: a test parses the scene.
    pub fn demo() -> Result<Self, SceneError> {
        Self::parse(Path::new("built-in demo"), DEMO)
    }

    /// Reads the built-in scene of experiments. A plugin other than the spring replaces the spring, with the default mapping.
    ///
    /// # Errors
    /// Never in practice: a test parses the scene.
    pub fn study(model: &str) -> Result<Self, SceneError> {
        let mut scene = Self::parse(Path::new("built-in study"), STUDY)?;
        if let Some(object) = scene.models.iter_mut().find(|object| object.name != model) {
            *object = object.replaced_by(Some(model), &[]);
            model.clone_into(&mut object.name);
            object.mapping = MappingConfig::default();
        }
        Ok(scene)
    }

    /// Reads a scene file, or, if no file has this path, one of Flotor's own scenes by its name. Not real-time.
    ///
    /// # Errors
    /// [`SceneError`] with file, line, key and remedy.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        if let Some(own) = OwnScene::named(path) {
            return own.read();
        }
        let text = read_text(path, "the scene").map_err(|TextProblem { line, problem }| {
            let advice = if path.is_file() { String::new() } else { own::advice(path) };
            Location { file: path.into(), line }.problem(problem + &advice)
        })?;
        let mut scene = Self::parse(path, &text)?;
        let base = path.parent().unwrap_or(Path::new(""));
        for folder in &mut scene.plugin_folders {
            *folder = base.join(&*folder);
        }
        Ok(scene)
    }

    /// Reads a scene from text; `file` is its name in error messages.
    ///
    /// # Errors
    /// [`SceneError`] with file, line, key and remedy.
    pub fn parse(file: &Path, text: &str) -> Result<Self, SceneError> {
        Self::read(&Source::new(file, text))
    }

    /// Sets the loop rate, Hz, in place of the scene's; `place` is the location in error messages. Not real-time.
    ///
    /// # Errors
    /// [`SceneError`] if the watchdog timeout is shorter than three periods at the new rate.
    pub fn set_rate(&mut self, rate_hz: f64, place: &str) -> Result<(), SceneError> {
        let place = Location { file: PathBuf::from(place), line: 0 };
        legal_watchdog_s(self.limits.watchdog_s, rate_hz, place)?;
        self.rate_hz = rate_hz;
        Ok(())
    }

    fn read(source: &Source<'_>) -> Result<Self, SceneError> {
        let mut root = source.parse()?;
        let title = root.read("title", Value::text)?.unwrap_or_default();
        let rate_hz = root.number_or("rate_hz", 100.0..=10_000.0, 1000.0)?;
        let pacing = root.read("pacing", pacing)?.unwrap_or(Pacing::Host);
        let duration_s = root.number_or("duration_s", 0.0..=31_536_000.0, Self::DURATION_S)?;
        let folders = root.read("plugin_folders", Value::texts)?.unwrap_or_default();
        let devices = devices::read(&mut root)?;
        let models = root.sections("model")?.into_iter().map(|section| model(section, &devices));
        let models = models.collect::<Result<Vec<_>, _>>()?.concat();
        if let Some(model) = models.get(MAX_MODELS) {
            let problem = format!(
                "there are more than {MAX_MODELS} models; `grid` of `mapping` puts one model at many places"
            );
            return Err(model.plugin.location.problem(problem));
        }
        devices::tell_apart(&models, &devices)?;
        let limits = root.section("limits")?.map(|section| limits(section, rate_hz)).transpose()?;
        let limits = limits.unwrap_or_default();
        let scene = Self {
            title,
            text: source.text.to_owned(),
            rate_hz,
            pacing,
            duration_s,
            plugin_folders: folders.into_iter().map(PathBuf::from).collect(),
            couplings: coupling::read(root.sections("coupling")?, &devices, &limits)?,
            devices,
            models,
            limits,
            boundary: root.section("boundary")?.map_or_else(|| Ok(Boundary::default()), boundary)?,
            changes: change::read(root.sections("change")?)?,
        };
        root.finish()?;
        Ok(scene)
    }
}

/// Time base of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// Clock of the host; `read` of a device returns its newest sample, whatever its age.
    Host,
    /// Samples of the first device; before each `read` the loop waits for the device's next sample.
    Device,
}

fn pacing(value: Value<'_>) -> Result<Pacing, SceneError> {
    value.one_of(&[("host", Pacing::Host), ("device", Pacing::Device)])
}

/// Reads a model; returns one entry for each of its devices.
fn model(mut section: Section<'_>, devices: &[DeviceUse]) -> Result<Vec<ModelUse>, SceneError> {
    let plugin = plugin_use(&mut section)?;
    let name = section.read("name", devices::name)?;
    let on = devices::of_model(devices, section.take("device"), &plugin.location)?;
    let sharing = shared::read(&mut section, &on, devices)?;
    let (mapping, places_m) = match section.section("mapping")? {
        Some(section) => mapping(section)?,
        None => (MappingConfig::default(), vec![[0.0; 3]]),
    };
    let blend = section.section("blend")?.map_or_else(|| Ok(Blend::default()), blend)?;
    let isolation = section.read("isolation", isolation)?.unwrap_or_default();
    let budget_us = section.number("budget_us", 1.0..=1.0e6)?;
    let field = section.section("field")?.map(field).transpose()?;
    section.finish()?;
    let name = name.unwrap_or_else(|| plugin.plugin.clone());
    let model = ModelUse {
        name,
        plugin,
        device: 0,
        mapping,
        places_m,
        shared_with: Vec::new(),
        blend,
        isolation,
        field,
        budget_s: budget_us.map(|microseconds| microseconds * 1.0e-6),
        latency_s: 0.0,
    };
    if let Some(sharing) = sharing {
        return sharing.of(model, &on).map(|model| vec![model]);
    }
    let only = on.len() == 1;
    let on_device = |number: u16| {
        let device = devices.get(usize::from(number)).filter(|_| !only);
        let name = device.map_or_else(|| model.name.clone(), |device| devices::name_on(&model.name, device));
        ModelUse { name, device: number, ..model.clone() }
    };
    Ok(on.into_iter().map(on_device).collect())
}

/// Reads timing and limits of an asynchronous model.
fn field(mut section: Section<'_>) -> Result<FieldTiming, SceneError> {
    let rate_hz = section.require("rate_hz")?.number(1.0..=10_000.0)?;
    let period_s = 1.0 / rate_hz;
    let latency_s =
        section.number("latency_ms", 0.0..=period_s * 1.0e3)?.map(|milliseconds| milliseconds * 1.0e-3);
    let known = ContactLimits::UNKNOWN;
    let contacts = ContactLimits {
        cap: section.read("cap", Value::truth)?.unwrap_or(true).then_some(StiffnessCap::UNKNOWN),
        surface_power_w: section.number_or("surface_power_w", 1.0e-6..=100.0, known.surface_power_w)?,
        ..known
    };
    section.finish()?;
    // Default: the model needs its whole period.
    Ok(FieldTiming { rate_hz, latency_s: latency_s.unwrap_or(period_s), contacts })
}

fn blend(mut section: Section<'_>) -> Result<Blend, SceneError> {
    let default = Blend::default();
    let priority = section.read("priority", |value| value.whole(0..=u8::MAX.into()))?;
    let blend = Blend {
        weight: section.number_or("weight", 0.0..=1.0, default.weight)?,
        priority: priority.and_then(|priority| u8::try_from(priority).ok()).unwrap_or(default.priority),
        fade_s: section.number_or("fade_s", 0.0..=60.0, default.fade_s)?,
    };
    section.finish()?;
    Ok(blend)
}

fn plugin_use(section: &mut Section<'_>) -> Result<PluginUse, SceneError> {
    let plugin = section.require("plugin")?;
    let location = plugin.location.clone();
    let parameters = section.section("parameters")?.map_or_else(|| Ok(Vec::new()), Section::into_texts)?;
    Ok(PluginUse { plugin: plugin.text()?, location, parameters })
}

/// Reads scales, rotation and positions of a model.
fn mapping(mut section: Section<'_>) -> Result<(MappingConfig, Vec<[f64; 3]>), SceneError> {
    let torque_scale = section.number("torque_scale", SCALE)?;
    let mapping = MappingConfig { torque_scale, ..frame_and_scales(&mut section)? };
    let places_m = placement::read(&mut section)?;
    section.finish()?;
    Ok((mapping, places_m))
}

/// Reads rotation and scales, without the torque scale.
fn frame_and_scales(section: &mut Section<'_>) -> Result<MappingConfig, SceneError> {
    let default = MappingConfig::default();
    Ok(MappingConfig {
        rotation_xyzw: section.read("rotation_xyzw", rotation)?.unwrap_or(default.rotation_xyzw),
        motion_scale: section.number_or("motion_scale", SCALE, default.motion_scale)?,
        force_scale: section.number_or("force_scale", SCALE, default.force_scale)?,
        torque_scale: None,
    })
}

fn rotation(value: Value<'_>) -> Result<[f64; 4], SceneError> {
    let rotation = DQuat::from_array(value.numbers()?);
    if is_rotation(rotation) {
        return Ok((rotation / rotation.length()).to_array());
    }
    Err(value.problem(format!(
        "a rotation must be a unit quaternion [x, y, z, w], but this quaternion has length {}; divide its \
         numbers by the length, or write [0, 0, 0, 1] for no rotation",
        rotation.length()
    )))
}

/// Legal scales: zero would suppress motion or force, and a larger scale indicates a wrong unit.
const SCALE: std::ops::RangeInclusive<f64> = 1.0e-6..=1.0e6;

/// Largest number of models, counted once for each device: the calls alone of so many take a millisecond.
const MAX_MODELS: usize = 4096;

/// Longest watchdog timeout, ms.
const LONGEST_WATCHDOG_MS: f64 = 60_000.0;

/// Shortest watchdog timeout, in periods: one period passes between two ticks of a healthy loop, a late tick adds another, and the
/// watchdog's own polls are late as well.
const WATCHDOG_PERIODS: f64 = 3.0;

/// Returns `watchdog_s` if it is at least [`WATCHDOG_PERIODS`] periods at this rate; `place` is the location in error messages.
fn legal_watchdog_s(watchdog_s: f64, rate_hz: f64, place: Location) -> Result<f64, SceneError> {
    let least_ms = WATCHDOG_PERIODS * 1.0e3 / rate_hz;
    // Rounded to a microsecond: the conversion from ms to s and back has a rounding error.
    let watchdog_ms = (watchdog_s * 1.0e6).round() / 1.0e3;
    if watchdog_ms > least_ms - 1.0e-3 {
        return Ok(watchdog_s);
    }
    // Rounded up, so that the value in the message is legal.
    let least_ms = (least_ms * 100.0).ceil() / 100.0;
    let problem = format!(
        "`limits.watchdog_ms` = {watchdog_ms}: at {rate_hz} Hz it must be {least_ms} to {LONGEST_WATCHDOG_MS}, \
         at least three periods of the loop"
    );
    Err(place.problem(problem))
}

/// Upper end of the legal range of a limit: none.
const MOST: f64 = f64::INFINITY;

fn limits(mut section: Section<'_>, rate_hz: f64) -> Result<Limits, SceneError> {
    let default = Limits::default();
    let force_n = section.bound_or("force_n", 0.0..=MOST, default.force_n)?;
    let torque_nm = section.bound_or("torque_nm", 0.0..=MOST, default.torque_nm)?;
    let mut number = |key, least, default| section.number_or(key, least..=MOST, default);
    let limits = Limits {
        force_n,
        torque_nm,
        grip_force_n: number("grip_force_n", 0.0, default.grip_force_n)?,
        grip_torque_nm: number("grip_torque_nm", 0.0, default.grip_torque_nm)?,
        force_slew_n_per_s: number("force_slew_n_per_s", 1.0, default.force_slew_n_per_s)?,
        torque_slew_nm_per_s: number("torque_slew_nm_per_s", 0.01, default.torque_slew_nm_per_s)?,
        velocity_m_per_s: section.bound_or("velocity_m_per_s", 1.0e-6..=MOST, default.velocity_m_per_s)?,
        angular_velocity_rad_per_s: section.bound_or(
            "angular_velocity_rad_per_s",
            1.0e-6..=MOST,
            default.angular_velocity_rad_per_s,
        )?,
        ramp_s: section.number_or("ramp_s", 0.0..=60.0, default.ramp_s)?,
        watchdog_s: section
            .number_and_place("watchdog_ms", 1.0..=LONGEST_WATCHDOG_MS)?
            .map_or(Ok(default.watchdog_s), |(ms, place)| legal_watchdog_s(ms * 1.0e-3, rate_hz, place))?,
        emergency_buttons: section
            .read("emergency_button", |value| value.whole(0..=31))?
            .map_or(default.emergency_buttons, |button| 1 << button),
        passivity: section.read("passivity", passivity)?.unwrap_or(default.passivity),
        require_independent_stop: section.read("require_independent_stop", Value::truth)?.unwrap_or(false),
        accept_shared_control_group: section
            .read("accept_shared_control_group", Value::truth)?
            .unwrap_or(false),
    };
    section.finish()?;
    Ok(limits)
}

fn isolation(value: Value<'_>) -> Result<Isolation, SceneError> {
    value.one_of(&[("none", Isolation::None), ("process", Isolation::Process)])
}

fn passivity(value: Value<'_>) -> Result<PassivityMode, SceneError> {
    value.one_of(&[("observe", PassivityMode::Observe), ("control", PassivityMode::Control)])
}

fn boundary(mut section: Section<'_>) -> Result<Boundary, SceneError> {
    let default = Boundary::default();
    let millimetres = section.number("margin_mm", 0.0..=100.0)?;
    let degrees = section.number("margin_deg", 0.0..=90.0)?;
    let mut gain = |key, most, default| section.number_or(key, 0.0..=most, default);
    let boundary = Boundary {
        margin_m: millimetres.map_or(default.margin_m, |mm| mm * 1.0e-3),
        margin_rad: degrees.map_or(default.margin_rad, f64::to_radians),
        stiffness_n_per_m: gain("stiffness_n_per_m", 1.0e5, default.stiffness_n_per_m)?,
        damping_ns_per_m: gain("damping_ns_per_m", 1.0e3, default.damping_ns_per_m)?,
        stiffness_nm_per_rad: gain("stiffness_nm_per_rad", 1.0e3, default.stiffness_nm_per_rad)?,
        damping_nms_per_rad: gain("damping_nms_per_rad", 10.0, default.damping_nms_per_rad)?,
    };
    section.finish()?;
    Ok(boundary)
}
