//! Table of the plugins of a run with their replacements: checks new values before the loop receives them, and describes the
//! changes that the loop reports.

use super::super::plugin_report::PluginReport;
use super::error::ControlError;
use super::versions::{ChosenBy, Versions};
use crate::scene::{is_named, nearest};
use flotor_core::lock;
use flotor_core::{Change, ChangeSubject, PluginIndex};
use flotor_hal::abi::PluginKind;
use flotor_hal::{Mutability, Parameter};
use flotor_loader::Setting;
use flotor_servo::{ChangeReport, PLUGIN, Pace, ParameterChange, WEIGHT};
use std::sync::{Arc, Mutex, MutexGuard};

/// New value for a parameter of a plugin of the run, as text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NewValue<'a> {
    /// Name of a device or model in the scene (a model on several devices: `NAME@DEVICE` for one device, `NAME` for all devices),
    /// or id of a plugin.
    pub plugin: &'a str,
    /// Id of the parameter.
    pub parameter: &'a str,
    /// Value in the syntax of scenes and of the command line.
    pub value: &'a str,
}

/// Parses a new value of a live parameter.
///
/// # Errors
/// [`ControlError::Setting`] for an unknown parameter or illegal value, [`ControlError::Fixed`] if the parameter is not live.
fn live_setting(part: &PluginReport, new: &NewValue<'_>) -> Result<Setting, ControlError> {
    let setting = Setting::parse(part.schema, new.parameter, new.value)
        .map_err(|error| ControlError::Setting { plugin: part.name.clone(), error })?;
    let is_live = |parameter: &Parameter| parameter.mutability() == Mutability::Live;
    if part.schema.get(setting.index()).is_some_and(is_live) {
        return Ok(setting);
    }
    let live = part.schema.iter().filter(|parameter| is_live(parameter));
    Err(ControlError::Fixed {
        plugin: part.name.clone(),
        id: new.parameter.to_owned(),
        live: live.map(|parameter| parameter.id().to_owned()).collect(),
    })
}

/// Returns true if a new value names a plugin and is legal for it. Not real-time.
pub(in super::super) fn understands(part: &PluginReport, new: &NewValue<'_>) -> bool {
    let is_named = is_named(&part.name, new.plugin) || part.metadata.id == new.plugin;
    is_named && live_setting(part, new).is_ok()
}

/// Plugins of a run, by number: devices, then models, in the scene's order. Clones share one table.
#[derive(Clone)]
pub(in super::super) struct PluginTable {
    places: Arc<Mutex<Vec<Versions>>>,
    devices: usize,
}

impl PluginTable {
    /// Creates the table of the plugins that a run begins with.
    pub(in super::super) fn new(plugins: &[PluginReport]) -> Self {
        let is_device = |plugin: &&PluginReport| plugin.metadata.kind == PluginKind::Device;
        let devices = plugins.iter().filter(is_device).count();
        Self { places: Arc::new(Mutex::new(plugins.iter().map(Versions::new).collect())), devices }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Vec<Versions>> {
        lock(&self.places)
    }

    /// Calls `on_model` with the versions of a model; returns `None` if the run has fewer models.
    fn model<T>(&self, model: usize, on_model: impl FnOnce(&mut Versions) -> T) -> Option<T> {
        self.lock().get_mut(PluginIndex::of_model(self.devices, model).position()).map(on_model)
    }

    /// Adds the replacement of a model and returns its generation; new values are checked against the replacement from now on.
    pub(in super::super) fn add(&self, model: usize, report: PluginReport, chosen_by: ChosenBy) -> u16 {
        self.model(model, |versions| versions.add(report, chosen_by)).unwrap_or(0)
    }

    /// Records that the loop has put a generation in place; new values are checked against this generation from now on.
    pub(super) fn set_current(&self, plugin: PluginIndex, generation: u16) {
        if let Some(versions) = self.lock().get_mut(plugin.position()) {
            (versions.current, versions.in_place) = (generation, generation);
            versions.forget();
        }
    }

    /// Returns the plugin of a model with this generation; `None` if the run has fewer models.
    pub(super) fn plugin(&self, model: usize, generation: u16) -> Option<PluginReport> {
        self.model(model, |versions| versions.get(generation).clone())
    }

    /// Returns the name of a model; if the run has fewer models, `plugin N` with the index among all plugins.
    pub(super) fn name(&self, model: usize) -> String {
        let name = self.model(model, |versions| versions.first.name.clone());
        name.unwrap_or_else(|| PluginIndex::of_model(self.devices, model).to_string())
    }

    /// Returns the replacements in place, except replacements that the seed chose.
    pub(super) fn replacements(&self) -> Vec<PluginReport> {
        let in_place = |versions: &Versions| {
            let mut later = versions.later.iter();
            let version = later.find(|version| version.generation == versions.in_place)?;
            (version.chosen_by == ChosenBy::Name).then(|| version.report.clone())
        };
        self.lock().iter().filter_map(in_place).collect()
    }

    /// Records that the loop has returned a generation of a model, which may be dropped.
    pub(super) fn retire(&self, model: usize, generation: u16) {
        self.model(model, |versions| versions.retire(generation));
    }

    /// Makes new values be checked against the plugins that the run begins with.
    pub(in super::super) fn start_with_the_first(&self) {
        self.lock().iter_mut().for_each(|versions| versions.current = 0);
    }

    /// Returns the numbers of the plugins with a name (a model has one on each of its devices), or of the first plugin with this id.
    fn numbers(&self, name: &str) -> Result<Vec<PluginIndex>, ControlError> {
        let places = self.lock();
        let numbered = || (0..).map(PluginIndex::at).zip(&*places);
        let named = numbered().filter(|(_, versions)| is_named(&versions.now().name, name));
        let found: Vec<PluginIndex> = named.map(|(number, _)| number).collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let of_id = numbered().find(|(_, versions)| versions.now().metadata.id == name);
        of_id.map(|(number, _)| vec![number]).ok_or_else(|| {
            let names = || places.iter().map(|versions| versions.now().name.as_str());
            ControlError::UnknownPlugin {
                name: name.to_owned(),
                nearest: nearest(name, names()).map(str::to_owned),
                names: names().map(str::to_owned).collect(),
            }
        })
    }

    /// Returns the numbers, counted among the models, of the models that a name names; an error for a device.
    pub(in super::super) fn models(&self, name: &str) -> Result<Vec<usize>, ControlError> {
        let no_model = || ControlError::NoWeight(name.to_owned());
        let model = |plugin: PluginIndex| plugin.among_models(self.devices).ok_or_else(no_model);
        self.numbers(name)?.into_iter().map(model).collect()
    }

    /// Returns the changes that give a model a new weight, limited to 0 to 1, on each of its devices.
    pub(in super::super) fn check_weight(
        &self,
        model: &str,
        weight: f64,
    ) -> Result<Vec<ParameterChange>, ControlError> {
        self.models(model)?;
        let value = weight.clamp(0.0, 1.0);
        let change =
            |plugin| ParameterChange { plugin, generation: 0, parameter: WEIGHT, value, pace: Pace::AtOnce };
        Ok(self.numbers(model)?.into_iter().map(change).collect())
    }

    /// Checks a new value and returns one change for each plugin that it names.
    pub(in super::super) fn check(&self, new: &NewValue<'_>) -> Result<Vec<ParameterChange>, ControlError> {
        self.numbers(new.plugin)?.into_iter().map(|plugin| self.check_one(plugin, new)).collect()
    }

    fn check_one(&self, plugin: PluginIndex, new: &NewValue<'_>) -> Result<ParameterChange, ControlError> {
        let places = self.lock();
        let versions = places.get(plugin.position()).ok_or(ControlError::Ended)?;
        let (part, generation) = (versions.now(), versions.current);
        let setting = live_setting(part, new)?;
        let parameter = u32::try_from(setting.index()).unwrap_or(u32::MAX); // schemas have tens of entries
        Ok(ParameterChange { plugin, generation, parameter, value: setting.value(), pace: Pace::AtOnce })
    }

    /// Returns the rate at which a user's request moves a number: a tenth of its soft range per 50 ms; at once for a parameter
    /// without a soft range.
    pub(super) fn pace(&self, change: &ParameterChange) -> Pace {
        let places = self.lock();
        let part = places.get(change.plugin.position()).map(|versions| versions.get(change.generation));
        let index = change.parameter as usize;
        part.and_then(|part| {
            let range = part.soft_ranges.get(index)?.as_ref()?;
            let (_, value) = part.parameters.get(index)?;
            let from = value.parse().ok().or_else(|| part.schema.get(index).map(Parameter::default))?;
            Some(Pace::Gradual { from, per_s: range.rate_per_s() })
        })
        .unwrap_or(Pace::AtOnce)
    }

    /// Describes a change that the loop has reported.
    pub(super) fn describe(&self, report: &ChangeReport) -> Change {
        let ChangeReport { tick, time_ns, change, outcome } = *report;
        let places = self.lock();
        let part = places.get(change.plugin.position()).map(|versions| versions.get(change.generation));
        let (subject, parameter, value) = match (part, change.parameter) {
            (_, WEIGHT) => (ChangeSubject::Weight, "weight".to_owned(), change.value.to_string()),
            (Some(part), PLUGIN) => {
                (ChangeSubject::Plugin, part.metadata.id.clone(), part.metadata.version.clone())
            }
            (Some(part), parameter) => {
                let id = part.schema.get(parameter as usize).map_or("", Parameter::id);
                let setting = Setting::number(part.schema, id, change.value);
                let shown = setting.map_or_else(|_| String::new(), |setting| setting.display());
                (ChangeSubject::Parameter, id.to_owned(), shown)
            }
            (None, _) => (ChangeSubject::Parameter, String::new(), String::new()),
        };
        let settings = part.filter(|_| subject == ChangeSubject::Plugin).map(|part| part.settings.clone());
        Change {
            tick,
            time_ns,
            plugin: part.map_or_else(|| change.plugin.to_string(), |part| part.name.clone()),
            subject,
            parameter,
            value,
            number: change.value,
            settings: settings.unwrap_or_default(),
            outcome,
        }
    }
}
