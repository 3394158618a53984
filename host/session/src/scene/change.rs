//! `[[change]]`: scheduled changes of a running scene.

use super::reader::{Location, SceneError, Section, Value};
use super::{ParameterText, PluginKeyValue};

/// Scheduled change of a parameter, a model or a weight.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeUse {
    /// Time since the start of the loop, s; applied before the first tick at this time or later.
    pub at_s: f64,
    /// Kind of the change, with its target and value.
    pub what: ChangeWhat,
    /// Location in the scene, for error messages.
    pub location: Location,
}

/// Kind of a scheduled change, with its target and value.
#[derive(Clone, Debug, PartialEq)]
pub enum ChangeWhat {
    /// New value of a parameter.
    Set {
        /// Name of a device or model in the scene (`device` for a single device without a name), or id of a plugin.
        plugin: String,
        /// Parameter with its value.
        parameter: ParameterText,
    },
    /// Replacement of a model with another plugin, or with a new instance of the same plugin.
    Swap {
        /// Name of a model in the scene, or id of a plugin.
        model: String,
        /// Alternatives for the model, at least one; of several, the seed of the run chooses one.
        by: Vec<Alternative>,
    },
    /// New weight of a model, which the loop approaches at the rate of the model's fade.
    Weight {
        /// Name of a model in the scene, or id of a plugin.
        model: String,
        /// Factor on the wrench of the model, 0 to 1.
        weight: f64,
    },
}

/// Alternative plugin for a hot swap of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Alternative {
    /// Id or file of the plugin; `None`: as named in the scene.
    pub plugin: Option<String>,
    /// Parameters of the replacement; without `plugin`, in addition to the model's parameters in the scene.
    pub parameters: Vec<ParameterText>,
}

impl Alternative {
    /// Reads the keys `plugin` and `parameters` of a table.
    fn take(section: &mut Section<'_>) -> Result<Self, SceneError> {
        let plugin = section.read("plugin", Value::text)?;
        let parameters =
            section.section("parameters")?.map_or_else(|| Ok(Vec::new()), Section::into_texts)?;
        Ok(Self { plugin, parameters })
    }
}

/// Latest time of a change, s: a year, as for the duration of a run.
const LATEST_S: f64 = 31_536_000.0;

/// Reads the changes of all tables in the order of the file; within a table: swap, parameters, weights. The changes of one table are
/// applied before the same tick.
pub(super) fn read(sections: Vec<Section<'_>>) -> Result<Vec<ChangeUse>, SceneError> {
    let mut changes = Vec::new();
    for mut section in sections {
        let at_s = section.require("at_s")?.number(0.0..=LATEST_S)?;
        let whole = section.location();
        let wrong = |problem: &str| Err(whole.problem(problem));
        let (set, weight, swap) = (section.take("set"), section.take("weight"), section.take("swap"));
        let alone = Alternative::take(&mut section)?;
        let either = section.sections("either")?;
        section.finish()?;
        if set.is_none() && weight.is_none() && swap.is_none() {
            return wrong(
                "`change.set`, `change.weight` or `change.swap` is missing; a `[[change]]` needs one of these keys",
            );
        }
        if swap.is_none() && (alone != Alternative::default() || !either.is_empty()) {
            return wrong(
                "`change.plugin`, `change.parameters` and `change.either` belong to a `change.swap`; add `swap`, or remove them",
            );
        }
        if alone != Alternative::default() && !either.is_empty() {
            return wrong(
                "`change.either` has `plugin` and `parameters` in each alternative; remove the keys `plugin` and \
                 `parameters` beside `either`",
            );
        }
        if let Some(swap) = swap {
            let location = swap.location.clone();
            let several = either.into_iter().map(|mut alternative| {
                let taken = Alternative::take(&mut alternative)?;
                alternative.finish()?;
                Ok(taken)
            });
            let several = several.collect::<Result<Vec<_>, SceneError>>()?;
            let by = if several.is_empty() { vec![alone] } else { several };
            changes.push(ChangeUse { at_s, what: ChangeWhat::Swap { model: swap.text()?, by }, location });
        }
        let read: [(_, Read); 2] = [(set, parameter), (weight, weight_of)];
        for (value, what) in read {
            let Some(value) = value else { continue };
            let location = value.location.clone();
            for text in value.one_or_more_texts()? {
                changes.push(ChangeUse { at_s, what: what(&text, &location)?, location: location.clone() });
            }
        }
    }
    Ok(changes)
}

/// Function that parses a change from its text and location.
type Read = fn(&str, &Location) -> Result<ChangeWhat, SceneError>;

/// Reads `PLUGIN.KEY=VALUE`.
fn parameter(text: &str, location: &Location) -> Result<ChangeWhat, SceneError> {
    let setting = text.parse::<PluginKeyValue>();
    let setting = setting.map_err(|problem| location.problem(format!("`change.set`: {problem}")))?;
    let (plugin, key, value) = setting.into_parts();
    Ok(ChangeWhat::Set { plugin, parameter: ParameterText { key, value, location: location.clone() } })
}

/// Reads `MODEL=WEIGHT`.
fn weight_of(text: &str, location: &Location) -> Result<ChangeWhat, SceneError> {
    let parts = text.split_once('=').and_then(|(model, weight)| {
        let weight = weight.trim().parse::<f64>().ok().filter(|weight| (0.0..=1.0).contains(weight))?;
        Some(ChangeWhat::Weight { model: model.trim().to_owned(), weight })
    });
    parts.ok_or_else(|| {
        location.problem(format!(
            "`change.weight`: `{text}` is not MODEL=WEIGHT with a weight from 0 to 1, like spring=0.5"
        ))
    })
}
