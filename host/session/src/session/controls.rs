//! What other threads may tell a running loop: new values of parameters, weights, other models.
//!
//! Words are checked against the plugin's schema here, off the loop; only numbers travel into it.

use super::PluginReport;
use super::prepare::prepare_model_while;
use crate::calls::{Attended, Call, Unresponsive, end_limit};
use crate::registry::Registry;
use crate::scene::{Location, ModelUse, is_named, nearest};
use flotor_core::{Change, ChangeSubject};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{Setting, SettingError};
use flotor_hal::{LoopConfig, Mutability, Parameter};
use flotor_live::RefusalCause;
use flotor_servo::{
    ChangeReport, ChangeSender, Clock, HostSwaps, Layer, LayerReport, ModelHealth, PLUGIN, Pace,
    ParameterChange, Replacement, ReportReceiver, WEIGHT,
};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Why the loop was not told.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// No plugin of the run has this name.
    #[error(
        "the run has no plugin `{name}`{} (its plugins: {})",
        nearest.as_ref().map_or(String::new(), |n| format!("; did you mean `{n}`?")),
        names.join(", ")
    )]
    UnknownPlugin {
        /// The name in the request.
        name: String,
        /// The most similar name there is.
        nearest: Option<String>,
        /// All names.
        names: Vec<String>,
    },
    /// The plugin has no such parameter, or the value is not legal for it.
    #[error("[{plugin}] {error}")]
    Setting {
        /// The plugin.
        plugin: String,
        /// What is wrong.
        #[source]
        error: SettingError,
    },
    /// The parameter is only read when the plugin is created.
    #[error("[{plugin}] `{id}` cannot change while the loop runs; {}", live_words(live))]
    Fixed {
        /// The plugin.
        plugin: String,
        /// The parameter.
        id: String,
        /// Parameters that can.
        live: Vec<String>,
    },
    /// Only models are mixed and replaced.
    #[error("only models have a weight and can be swapped; this is a device")]
    NoWeight,
    /// A model cannot be replaced.
    #[error("[{model}] model unchanged: {problem}")]
    Refused {
        /// The model.
        model: String,
        /// Why.
        problem: String,
        /// What is wrong.
        cause: RefusalCause,
    },
    /// More changes wait than the loop takes in, or the model replaced last is still fading.
    #[error("previous changes are pending, or a swap is still fading in; try again in a moment")]
    Busy,
    /// The loop has ended.
    #[error("the run is over")]
    Ended,
}

fn live_words(live: &[String]) -> String {
    if live.is_empty() {
        "none of its parameters can".to_owned()
    } else {
        format!("parameters that can: {}", live.join(", "))
    }
}

/// A new value for a parameter of a plugin of the run, in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NewValue<'a> {
    /// The name of a device or model in the scene (a model on several devices: `NAME@DEVICE` is the one on that
    /// device, `NAME` all), or a plugin's id.
    pub plugin: &'a str,
    /// Id of the parameter.
    pub parameter: &'a str,
    /// Its value, as a person would type it.
    pub value: &'a str,
}

/// A handle to a running loop, for any thread; clone it freely. Nothing here makes the loop wait.
#[derive(Clone)]
pub struct Controls {
    shared: Arc<Shared>,
}

struct Shared {
    parts: Parts,
    /// Panels and scripts wait here for each other; the loop never touches this lock.
    changes: Mutex<ChangeSender>,
    /// The models as the scene has them: where a replacement goes, and how it is mixed.
    models: Vec<ModelUse>,
    config: LoopConfig,
    clock: Clock,
    supervised: Mutex<Supervised>,
}

impl Shared {
    fn changes(&self) -> MutexGuard<'_, ChangeSender> {
        self.changes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A plugin that had the place of a model for a part of a run, and did not behave.
#[derive(Clone, Debug)]
pub struct Misbehaved {
    /// The plugin; its name is that of the model.
    pub plugin: PluginReport,
    /// What it did.
    pub health: ModelHealth,
    /// Its last words; may be empty.
    pub words: String,
}

/// The queues of the hot swap, which models have a replacement on its way or fading in, and who came back with a fault.
struct Supervised {
    swaps: HostSwaps,
    busy: Vec<bool>,
    /// With the number of the model and which of its plugins it was: of each file the first, so that there is an end to them.
    misbehaved: Vec<(usize, u16, Misbehaved)>,
    /// What people should know of plugins that came later, a sentence each.
    warnings: Vec<String>,
    /// Those that are being freed: whoever sweeps does not wait for the code of a plugin.
    leaving: Vec<Attended<LayerReport>>,
    /// The first that was not freed in time.
    hung: Option<Unresponsive>,
}

/// What is known of the models of a run that is over.
pub(super) struct Settled {
    /// Health and last words of those it began with, in the scene's order.
    pub(super) first: Vec<(ModelHealth, String)>,
    /// Of those that came later the ones that did not behave.
    pub(super) misbehaved: Vec<Misbehaved>,
    /// Of those that came later the ones in place at the end.
    pub(super) replacements: Vec<PluginReport>,
    /// The first that was not freed in time.
    pub(super) hung: Option<Unresponsive>,
}

impl Supervised {
    /// Lets what the loop has handed back be freed, and hears of those that are. Not real-time; waits for nobody.
    fn sweep(&mut self, parts: &Parts) {
        while let Ok((model, mut layer)) = self.swaps.retired.pop() {
            let number = model as usize;
            let who = parts.plugin(number, layer.generation()).map_or_else(String::new, |plugin| plugin.name);
            let freed = Attended::start(end_limit(), move |progress| {
                let report = layer.report(number, || progress.enter(&who, Call::LastMessage));
                progress.enter(&who, Call::Destroy);
                drop(layer);
                report
            });
            self.leaving.extend(freed);
            if let Some(busy) = self.busy.get_mut(number) {
                *busy = false;
            }
        }
        self.hear(parts, Duration::ZERO);
    }

    /// Takes these models for a replacement, all or none.
    fn take(&mut self, parts: &Parts, numbers: &[usize]) -> Result<(), ControlError> {
        self.sweep(parts);
        if numbers.iter().any(|number| self.busy.get(*number).is_none_or(|busy| *busy)) {
            return Err(ControlError::Busy);
        }
        self.set_busy(numbers, true);
        Ok(())
    }

    /// Gives them back: there is no replacement.
    fn release(&mut self, numbers: &[usize]) {
        self.set_busy(numbers, false);
    }

    fn set_busy(&mut self, numbers: &[usize], is_busy: bool) {
        let models = self.busy.iter_mut().enumerate().filter(|(number, _)| numbers.contains(number));
        models.for_each(|(_, busy)| *busy = is_busy);
    }

    /// Hears of those that are freed, each within a time.
    fn hear(&mut self, parts: &Parts, time: Duration) {
        let mut at = 0;
        while let Some(calls) = self.leaving.get(at) {
            let Some(freed) = calls.look(time) else {
                at += 1;
                continue;
            };
            self.leaving.swap_remove(at);
            match freed {
                Ok(report) => {
                    let (model, generation) = (report.model, report.generation);
                    self.note(parts, report);
                    parts.forget(model, generation);
                }
                Err(hung) => {
                    self.hung.get_or_insert(hung);
                }
            }
        }
    }

    /// Keeps what is to be said of a layer, if there is anything.
    fn note(&mut self, parts: &Parts, report: LayerReport) {
        let LayerReport { model, generation, health, words } = report;
        if health.is_good() {
            return;
        }
        let Some(plugin) = parts.plugin(model, generation) else { return };
        let is_known = |(of, which, known): &(usize, u16, Misbehaved)| {
            *of == model
                && (*which == 0) == (generation == 0)
                && known.plugin.metadata.path == plugin.metadata.path
        };
        if !self.misbehaved.iter().any(is_known) {
            self.misbehaved.push((model, generation, Misbehaved { plugin, health, words }));
        }
    }
}

impl Controls {
    pub(super) fn new(
        parts: Parts,
        changes: ChangeSender,
        models: &[ModelUse],
        (config, clock): (LoopConfig, Clock),
        swaps: HostSwaps,
    ) -> Self {
        let supervised = Supervised {
            swaps,
            busy: vec![false; models.len()],
            misbehaved: Vec::new(),
            warnings: Vec::new(),
            leaving: Vec::new(),
            hung: None,
        };
        let (changes, supervised) = (Mutex::new(changes), Mutex::new(supervised));
        Self {
            shared: Arc::new(Shared { parts, changes, models: models.to_vec(), config, clock, supervised }),
        }
    }

    /// Every plugin of the run with its schema: the device, then the models in the scene's order.
    #[must_use]
    pub fn plugins(&self) -> Vec<(String, &'static [Parameter])> {
        let plugins = self.shared.parts.lock();
        plugins.iter().map(|plugin| (plugin.now().name.clone(), plugin.now().schema)).collect()
    }

    /// Moves a live parameter to a new value, a tenth of its [soft range](flotor_hal::SoftRange) in 50 ms; what is no number
    /// changes before the next tick. Not real-time.
    ///
    /// The plugin may still refuse it, if it does not fit its other values: observers are told what became of it
    /// ([`super::Observer::change`]).
    ///
    /// # Errors
    /// [`ControlError`]: no such plugin, parameter or value; not a live one; the loop is busy or over.
    pub fn set_parameter(&self, plugin: &str, parameter: &str, value: &str) -> Result<(), ControlError> {
        self.set_parameters(&[NewValue { plugin, parameter, value }])
    }

    /// Moves several live parameters to new values, all from the same tick on; each as [`Controls::set_parameter`] does. Not
    /// real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then none of them changes.
    pub fn set_parameters(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let Shared { parts, .. } = &*self.shared;
        let slowed = |change: &ParameterChange| ParameterChange { pace: parts.pace(change), ..*change };
        let checked = values.iter().map(|value| parts.check(value)).collect::<Result<Vec<_>, _>>()?.concat();
        self.send(&checked.iter().map(slowed).collect::<Vec<_>>())
    }

    /// Gives several live parameters new values, all before the same tick: for what no hand feels while it changes, such as the
    /// next stimulus of an experiment. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then none of them changes.
    pub fn set_parameters_at_once(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let checked = values.iter().map(|value| self.shared.parts.check(value));
        self.send(&checked.collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Lets a model be felt more or less: its weight moves there at the rate of its fade, from the next tick on. A
    /// weight of 0 silences it, and it is not asked any more. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: no such model; the loop is busy or over.
    pub fn set_weight(&self, model: &str, weight: f64) -> Result<(), ControlError> {
        self.send(&self.shared.parts.check_weight(model, weight)?)
    }

    fn send(&self, checked: &[ParameterChange]) -> Result<(), ControlError> {
        let mut changes = self.shared.changes();
        if changes.is_abandoned() {
            return Err(ControlError::Ended);
        }
        // All or none, and the loop sees them at once.
        changes.push_entire_slice(checked).map_err(|_| ControlError::Busy)
    }

    /// Hot swap of a model by another plugin, or by the same one rebuilt: the new one is loaded and created here, and fades
    /// in from the next tick on while the old one fades out. Not real-time: takes as long as creating the model.
    ///
    /// Without `plugin` it is the one the scene names, with the scene's settings; another one starts from its own
    /// defaults. `settings` come on top. Places, mapping and weight stay.
    ///
    /// # Errors
    /// [`ControlError`]: no such model; the plugin is refused; the model replaced last is still fading; the loop is over.
    pub fn swap(
        &self,
        registry: &Registry,
        model: &str,
        plugin: Option<&str>,
        settings: &[(&str, &str)],
    ) -> Result<(), ControlError> {
        let Shared { parts, models, config, clock, .. } = &*self.shared;
        let numbers = parts.models(model)?;
        if self.shared.changes().is_abandoned() {
            return Err(ControlError::Ended);
        }
        self.supervised().take(parts, &numbers)?;
        let refused = |error: super::RunError| ControlError::Refused {
            model: model.to_owned(),
            problem: error.to_string(),
            cause: if error.is_configuration() { RefusalCause::Request } else { RefusalCause::Plugin },
        };
        let make = |number: &usize| {
            let mut other = models.get(*number).ok_or(ControlError::Ended)?.replaced_by(plugin, settings);
            if plugin.is_some() {
                other.plugin.location = Location { file: "--plugin".into(), line: 0 };
            }
            // A run that is over does not wait for the code of a plugin.
            let is_wanted = || !self.shared.changes().is_abandoned();
            prepare_model_while(registry, &other, config, *clock, is_wanted).map_err(refused)
        };
        // Without the lock: the run goes on meanwhile, and may end.
        let made = numbers.iter().map(make).collect::<Result<Vec<_>, _>>();
        let mut supervised = self.supervised();
        let made = made.inspect_err(|_| supervised.release(&numbers))?;
        for (number, (layer, report)) in numbers.into_iter().zip(made) {
            supervised.warnings.extend(report.warning());
            let generation = parts.put_in(number, report, ChosenBy::Name);
            let model = u32::try_from(number).unwrap_or(u32::MAX); // a scene has fewer models
            let replacement = Replacement { model, generation, layer: Box::new(layer) };
            // There is room: at most one of each model is on its way.
            let pushed = supervised.swaps.leaving_for_the_loop.push(replacement);
            if let Some(busy) = supervised.busy.get_mut(number) {
                *busy = pushed.is_ok();
            }
            pushed.map_err(|_| ControlError::Busy)?;
        }
        Ok(())
    }

    /// What people should know of plugins that came later, a sentence each. Not real-time.
    pub(super) fn warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.supervised().warnings)
    }

    fn supervised(&self) -> MutexGuard<'_, Supervised> {
        self.shared.supervised.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Drops models the loop has handed back, unless somebody else is at it. Not real-time.
    pub(super) fn sweep(&self) {
        if let Ok(mut supervised) = self.shared.supervised.try_lock() {
            supervised.sweep(&self.shared.parts);
        }
    }

    /// What a loop that is over handed back last, each with the number of its model. Not real-time.
    pub(super) fn take_retired(&self) -> Vec<(usize, Box<Layer>)> {
        let mut supervised = self.supervised();
        let retired = std::iter::from_fn(|| supervised.swaps.retired.pop().ok());
        retired.map(|(model, layer)| (model as usize, layer)).collect()
    }

    /// How the plugins in place of the models have behaved in a run that is over, `left` being what is still in the loop.
    /// Not real-time.
    pub(super) fn settle(&self, left: Vec<LayerReport>) -> Settled {
        let Shared { parts, models, .. } = &*self.shared;
        let mut supervised = self.supervised();
        supervised.hear(parts, end_limit());
        let mut first = vec![(ModelHealth::default(), String::new()); models.len()];
        for report in left {
            if let (0, Some(first)) = (report.generation, first.get_mut(report.model)) {
                *first = (report.health, report.words);
            } else {
                supervised.note(parts, report);
            }
        }
        let mut later = Vec::new();
        for (model, generation, misbehaved) in &supervised.misbehaved {
            match first.get_mut(*model) {
                Some(first) if *generation == 0 => *first = (misbehaved.health, misbehaved.words.clone()),
                _ => later.push(misbehaved.clone()),
            }
        }
        let replacements = parts.replacements();
        Settled { first, misbehaved: later, replacements, hung: supervised.hung.take() }
    }
}

/// Versions of a model that there is room for all the time: the one in place, the one before, one that comes, one that goes.
const USUAL_VERSIONS: usize = 4;

/// A plugin of a run, and those that took its place.
pub(super) struct Versions {
    first: PluginReport,
    /// Those that may still be spoken of, in the order in which they came.
    later: VecDeque<Version>,
    /// The generation that was given last.
    newest: u16,
    /// Which one changes are checked against.
    current: u16,
    /// The last that is known to have come in.
    in_place: u16,
}

/// Who chose a replacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ChosenBy {
    /// The scene, or a person.
    Name,
    /// The seed, among several: nobody is told which.
    Seed,
}

/// A plugin that took the place of another.
struct Version {
    generation: u16,
    report: PluginReport,
    chosen_by: ChosenBy,
    /// The loop has handed it back.
    is_back: bool,
}

impl Versions {
    fn get(&self, generation: u16) -> &PluginReport {
        let meant = self.later.iter().find(|version| version.generation == generation);
        meant.map_or(&self.first, |version| &version.report)
    }

    /// One more, and its generation. After the last number comes that of the first replacement again: whose it was is
    /// long forgotten then. 0 stays with the plugin of the scene.
    fn put_in(&mut self, report: PluginReport, chosen_by: ChosenBy) -> u16 {
        self.newest = self.newest.checked_add(1).unwrap_or(1);
        self.current = self.newest;
        self.later.push_back(Version { generation: self.newest, report, chosen_by, is_back: false });
        self.newest
    }

    /// Forgets those that nobody will speak of any more, so that a run may replace its models for ever. The one before
    /// the one in place may still be named by a change that was under way; an older one by the loop, until it is back.
    fn forget(&mut self) {
        let in_place = self.later.iter().position(|version| version.generation == self.in_place);
        let mut old = in_place.unwrap_or(0).saturating_sub(1);
        while old > 0 && self.later.front().is_some_and(|version| version.is_back) {
            self.later.pop_front();
            old -= 1;
        }
        // More were here once, when somebody was slow.
        self.later.shrink_to(USUAL_VERSIONS);
    }

    fn now(&self) -> &PluginReport {
        self.get(self.current)
    }
}

/// A new value of a live parameter, from words to a number.
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

/// True if a plugin is meant by a new value and understands it. Not real-time.
pub(super) fn understands(part: &PluginReport, new: &NewValue<'_>) -> bool {
    let is_meant = is_named(&part.name, new.plugin) || part.metadata.id == new.plugin;
    is_meant && live_setting(part, new).is_ok()
}

/// The plugins of a run as changes name them.
#[derive(Clone)]
pub(super) struct Parts {
    list: Arc<Mutex<Vec<Versions>>>,
}

impl Parts {
    /// Of the plugins by number: the device, then the models in the scene's order.
    pub(super) fn new(plugins: &[PluginReport]) -> Self {
        let versions = |report: &PluginReport| Versions {
            first: report.clone(),
            later: VecDeque::new(),
            newest: 0,
            current: 0,
            in_place: 0,
        };
        Self { list: Arc::new(Mutex::new(plugins.iter().map(versions).collect())) }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Versions>> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The hot swap of a model: changes are checked against it from now on. Its generation.
    pub(super) fn put_in(&self, model: usize, report: PluginReport, chosen_by: ChosenBy) -> u16 {
        let mut list = self.lock();
        let devices = devices(&list);
        list.get_mut(devices + model).map_or(0, |versions| versions.put_in(report, chosen_by))
    }

    /// Which plugin of a place changes are checked against.
    pub(super) fn set_current(&self, plugin: u16, generation: u16) {
        if let Some(versions) = self.lock().get_mut(usize::from(plugin)) {
            (versions.current, versions.in_place) = (generation, generation);
            versions.forget();
        }
    }

    /// The plugin that had this number among those swapped in.
    fn plugin(&self, model: usize, generation: u16) -> Option<PluginReport> {
        let list = self.lock();
        list.get(devices(&list) + model).map(|versions| versions.get(generation).clone())
    }

    /// The plugins in place of the first ones, but for those that the seed chose.
    fn replacements(&self) -> Vec<PluginReport> {
        let in_place = |versions: &Versions| {
            let mut later = versions.later.iter();
            let version = later.find(|version| version.generation == versions.in_place)?;
            (version.chosen_by == ChosenBy::Name).then(|| version.report.clone())
        };
        self.lock().iter().filter_map(in_place).collect()
    }

    /// The loop has handed back the one of this number: it may be forgotten.
    fn forget(&self, model: usize, generation: u16) {
        let mut list = self.lock();
        let devices = devices(&list);
        let Some(versions) = list.get_mut(devices + model) else { return };
        let back = versions.later.iter_mut().find(|version| version.generation == generation);
        if let Some(version) = back {
            version.is_back = true;
        }
        versions.forget();
    }

    /// Changes are checked against the plugins a run begins with.
    pub(super) fn start_with_the_first(&self) {
        self.lock().iter_mut().for_each(|versions| versions.current = 0);
    }

    /// The numbers of the plugins of a name: one, or a model on all its devices; else the first of an id.
    fn numbers(&self, name: &str) -> Result<Vec<u16>, ControlError> {
        let list = self.lock();
        let named = |versions: &Versions| is_named(&versions.now().name, name);
        let found: Vec<u16> =
            (0..).zip(&*list).filter(|(_, versions)| named(versions)).map(|(number, _)| number).collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let of_id = (0..).zip(&*list).find(|(_, versions)| versions.now().metadata.id == name);
        of_id.map(|(number, _)| vec![number]).ok_or_else(|| {
            let names = || list.iter().map(|versions| versions.now().name.as_str());
            ControlError::UnknownPlugin {
                name: name.to_owned(),
                nearest: nearest(name, names()).map(str::to_owned),
                names: names().map(str::to_owned).collect(),
            }
        })
    }

    /// The numbers of the models of a name, among the models.
    pub(super) fn models(&self, name: &str) -> Result<Vec<usize>, ControlError> {
        let devices = devices(&self.lock());
        let model = |number: u16| usize::from(number).checked_sub(devices).ok_or(ControlError::NoWeight);
        self.numbers(name)?.into_iter().map(model).collect()
    }

    /// A new weight for a model.
    pub(super) fn check_weight(
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

    /// From words to numbers, if the words are right.
    pub(super) fn check(&self, new: &NewValue<'_>) -> Result<Vec<ParameterChange>, ControlError> {
        self.numbers(new.plugin)?.into_iter().map(|plugin| self.check_one(plugin, new)).collect()
    }

    fn check_one(&self, plugin: u16, new: &NewValue<'_>) -> Result<ParameterChange, ControlError> {
        let list = self.lock();
        let versions = list.get(usize::from(plugin)).ok_or(ControlError::Ended)?;
        let (part, generation) = (versions.now(), versions.current);
        let setting = live_setting(part, new)?;
        let parameter = u32::try_from(setting.index()).unwrap_or(u32::MAX); // schemas have tens of entries
        Ok(ParameterChange { plugin, generation, parameter, value: setting.value(), pace: Pace::AtOnce })
    }

    /// How fast a request of a person moves a number.
    fn pace(&self, change: &ParameterChange) -> Pace {
        let list = self.lock();
        let part = list.get(usize::from(change.plugin)).map(|versions| versions.get(change.generation));
        let index = change.parameter as usize;
        part.and_then(|part| {
            let range = part.soft_ranges.get(index)?.as_ref()?;
            let (_, value) = part.parameters.get(index)?;
            let from = value.parse().ok().or_else(|| part.schema.get(index).map(Parameter::default))?;
            Some(Pace::Gradual { from, per_s: range.rate_per_s() })
        })
        .unwrap_or(Pace::AtOnce)
    }

    /// From numbers back to words.
    fn describe(&self, report: &ChangeReport) -> Change {
        let ChangeReport { tick, time_ns, change, outcome } = *report;
        let list = self.lock();
        let part = list.get(usize::from(change.plugin)).map(|versions| versions.get(change.generation));
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
            plugin: part.map_or_else(String::new, |part| part.name.clone()),
            subject,
            parameter,
            value,
            number: change.value,
            settings: settings.unwrap_or_default(),
            outcome,
        }
    }
}

/// How many of the plugins are devices: they come first.
fn devices(plugins: &[Versions]) -> usize {
    plugins.iter().take_while(|versions| versions.now().metadata.kind == PluginKind::Device).count()
}

/// Hands the changes of a run to its observer, each before the tick it belongs to.
pub(super) struct ChangeLog {
    parts: Parts,
    reports: ReportReceiver,
    /// Taken out of the queue, and of a later tick than requested.
    waiting: Option<ChangeReport>,
}

impl ChangeLog {
    pub(super) fn new(parts: Parts, reports: ReportReceiver) -> Self {
        Self { parts, reports, waiting: None }
    }

    /// Hands on all changes up to a tick.
    pub(super) fn up_to(&mut self, tick: u64, mut look: impl FnMut(&Change)) {
        while let Some(report) = self.waiting.take().or_else(|| self.reports.pop().ok()) {
            if report.tick > tick {
                self.waiting = Some(report);
                return;
            }
            if report.change.parameter == PLUGIN {
                self.parts.set_current(report.change.plugin, report.change.generation);
            }
            look(&self.parts.describe(&report));
        }
    }
}
