//! What other threads may tell a running loop: new values of parameters.
//!
//! Words are checked against the plugin's schema here, off the loop; only numbers travel into it.

use super::PluginReport;
use crate::record::{Change, ChangeSubject};
use crate::scene::nearest;
use crate::servo::{ChangeReport, ChangeSender, ParameterChange, ReportReceiver, WEIGHT};
use flotor_hal::abi::loader::{Setting, SettingError};
use flotor_hal::{Mutability, Parameter};
use std::sync::Arc;

/// Why the loop was not told.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlError {
    /// No plugin of the run has this name.
    #[error(
        "there is no plugin `{name}`{} (there are {})",
        nearest.as_ref().map_or(String::new(), |n| format!("; did you mean `{n}`?")),
        names.join(", ")
    )]
    UnknownPlugin {
        /// What was asked for.
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
    /// Only models are mixed.
    #[error("the device has no weight; models have")]
    NoWeight,
    /// More changes wait than the loop takes in.
    #[error("the loop has not taken the changes before this one yet; try again after a tick")]
    Busy,
    /// The loop has ended.
    #[error("the run is over")]
    Ended,
}

fn live_words(live: &[String]) -> String {
    if live.is_empty() {
        "none of its parameters can".to_owned()
    } else {
        format!("what can: {}", live.join(", "))
    }
}

/// A new value for a parameter of a plugin of the run, in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NewValue<'a> {
    /// `device`, a model's name in the scene, or a plugin's id.
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
    changes: ChangeSender,
}

impl Controls {
    pub(super) fn new(parts: Parts, changes: ChangeSender) -> Self {
        Self { shared: Arc::new(Shared { parts, changes }) }
    }

    /// Every plugin of the run with its schema: the device, then the models in the scene's order.
    pub fn plugins(&self) -> impl Iterator<Item = (&str, &'static [Parameter])> {
        self.shared.parts.list.iter().map(|plugin| (plugin.name.as_str(), plugin.schema))
    }

    /// Gives a live parameter a new value before the next tick. Not real-time.
    ///
    /// The plugin may still refuse it, if it does not fit its other values: observers are told what became of it
    /// ([`super::Observer::change`]).
    ///
    /// # Errors
    /// [`ControlError`]: no such plugin, parameter or value; not a live one; the loop is busy or over.
    pub fn set_parameter(&self, plugin: &str, parameter: &str, value: &str) -> Result<(), ControlError> {
        self.set_parameters(&[NewValue { plugin, parameter, value }])
    }

    /// Gives several live parameters new values, all before the same tick. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then none of them changes.
    pub fn set_parameters(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let checked = values.iter().map(|value| self.shared.parts.check(value));
        self.send(&checked.collect::<Result<Vec<_>, _>>()?)
    }

    /// Lets a model be felt more or less: its weight moves there at the rate of its fade, from the next tick on. A
    /// weight of 0 silences it, and it is not asked any more. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: no such model; the loop is busy or over.
    pub fn set_weight(&self, model: &str, weight: f64) -> Result<(), ControlError> {
        self.send(&[self.shared.parts.check_weight(model, weight)?])
    }

    fn send(&self, checked: &[ParameterChange]) -> Result<(), ControlError> {
        let changes = &self.shared.changes;
        if changes.is_abandoned() {
            return Err(ControlError::Ended);
        }
        changes.send_all(checked).map_err(|flotor_sync::Full| ControlError::Busy)
    }
}

/// The plugins of a run as changes name them.
#[derive(Clone)]
pub(super) struct Parts {
    list: Arc<[PluginReport]>,
}

impl Parts {
    /// Of the plugins by number: the device, then the models in the scene's order.
    pub(super) fn new(plugins: &[PluginReport]) -> Self {
        Self { list: plugins.into() }
    }

    /// The plugin of a name or id, and its number.
    fn find(&self, name: &str) -> Result<(u32, &PluginReport), ControlError> {
        let names = || self.list.iter().map(|part| part.name.as_str());
        let found = (0..).zip(&*self.list).find(|(_, part)| part.name == name);
        let found = found.or_else(|| (0..).zip(&*self.list).find(|(_, part)| part.metadata.id == name));
        found.ok_or_else(|| ControlError::UnknownPlugin {
            name: name.to_owned(),
            nearest: nearest(name, names()).map(str::to_owned),
            names: names().map(str::to_owned).collect(),
        })
    }

    /// A new weight for a model.
    pub(super) fn check_weight(&self, model: &str, weight: f64) -> Result<ParameterChange, ControlError> {
        match self.find(model)? {
            (0, _) => Err(ControlError::NoWeight),
            (plugin, _) => Ok(ParameterChange { plugin, parameter: WEIGHT, value: weight.clamp(0.0, 1.0) }),
        }
    }

    /// From words to numbers, if the words are right.
    pub(super) fn check(&self, new: &NewValue<'_>) -> Result<ParameterChange, ControlError> {
        let (plugin, part) = self.find(new.plugin)?;
        let setting = Setting::parse(part.schema, new.parameter, new.value)
            .map_err(|error| ControlError::Setting { plugin: part.name.clone(), error })?;
        let is_live = |parameter: &Parameter| parameter.mutability() == Mutability::Live;
        if !part.schema.get(setting.index()).is_some_and(is_live) {
            let live = part.schema.iter().filter(|parameter| is_live(parameter));
            return Err(ControlError::Fixed {
                plugin: part.name.clone(),
                id: new.parameter.to_owned(),
                live: live.map(|parameter| parameter.id().to_owned()).collect(),
            });
        }
        let parameter = u32::try_from(setting.index()).unwrap_or(u32::MAX); // schemas have tens of entries
        Ok(ParameterChange { plugin, parameter, value: setting.value() })
    }

    /// From numbers back to words.
    fn describe(&self, report: &ChangeReport) -> Change {
        let ChangeReport { tick, time_ns, change, outcome } = *report;
        let part = self.list.get(change.plugin as usize);
        let name = part.map_or_else(String::new, |part| part.name.clone());
        if change.parameter == WEIGHT {
            return Change {
                tick,
                time_ns,
                plugin: name,
                subject: ChangeSubject::Weight,
                parameter: "weight".to_owned(),
                value: change.value.to_string(),
                number: change.value,
                outcome,
            };
        }
        let parameter = part.and_then(|part| part.schema.get(change.parameter as usize));
        let id = parameter.map_or("", Parameter::id);
        let shown = part.and_then(|part| Setting::number(part.schema, id, change.value).ok().zip(Some(part)));
        Change {
            tick,
            time_ns,
            plugin: name,
            subject: ChangeSubject::Parameter,
            parameter: id.to_owned(),
            value: shown.map_or_else(String::new, |(setting, part)| setting.display(part.schema)),
            number: change.value,
            outcome,
        }
    }
}

/// Hands the changes of a run to its observer, each before the tick it belongs to.
pub(super) struct ChangeLog {
    parts: Parts,
    reports: ReportReceiver,
    /// Taken out of the ring, and of a later tick than was asked for.
    waiting: Option<ChangeReport>,
}

impl ChangeLog {
    pub(super) fn new(parts: Parts, reports: ReportReceiver) -> Self {
        Self { parts, reports, waiting: None }
    }

    /// Hands on all changes up to a tick.
    pub(super) fn up_to(&mut self, tick: u64, mut look: impl FnMut(&Change)) {
        while let Some(report) = self.waiting.take().or_else(|| self.reports.pop()) {
            if report.tick > tick {
                self.waiting = Some(report);
                return;
            }
            look(&self.parts.describe(&report));
        }
    }
}
