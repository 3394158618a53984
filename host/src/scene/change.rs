//! `[[change]]`: what changes while a scene runs.

use super::reader::{SceneError, Section};
use super::{ParameterText, PluginKeyValue};

/// A parameter that gets a new value at a time known beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeUse {
    /// Applied before the first tick at this time or later, s since the start of the loop.
    pub at_s: f64,
    /// `device`, the name of a model in the scene, or a plugin's id.
    pub plugin: String,
    /// The parameter and its new value.
    pub parameter: ParameterText,
}

/// Longest time, s: a year, as for a run.
const LATEST_S: f64 = 31_536_000.0;

/// Every change of every table, in the order written. A table with several gives them the same time.
pub(super) fn read(sections: Vec<Section<'_>>) -> Result<Vec<ChangeUse>, SceneError> {
    let mut changes = Vec::new();
    for mut section in sections {
        let at_s = section.require("at_s")?.number(0.0..=LATEST_S)?;
        let set = section.require("set")?;
        let location = set.location.clone();
        section.finish()?;
        for text in set.one_or_more_texts()? {
            let setting = text.parse::<PluginKeyValue>().map_err(|problem| SceneError {
                location: location.clone(),
                problem: format!("`change.set`: {problem}"),
            })?;
            let (plugin, key, value) = setting.into_parts();
            let parameter = ParameterText { key, value, location: location.clone() };
            changes.push(ChangeUse { at_s, plugin, parameter });
        }
    }
    Ok(changes)
}
