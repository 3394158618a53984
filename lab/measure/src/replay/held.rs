//! Changes by the user for a replay, which override the changes of the run.

use flotor_session::scene::{KeyValue, ModelUse, PluginKeyValue, is_named};

/// Changes of models that last for a whole replay, in spite of changes recorded in the run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Held {
    /// Pairs of model and parameter with a changed value.
    parameters: Vec<(String, String)>,
    /// Names of models with another plugin.
    plugins: Vec<String>,
}

impl Held {
    /// Replaces models of the recording by `others`, then sets parameters. A model on several devices is changed on all
    /// of them, or by its full name on one. Not real-time.
    ///
    /// # Errors
    /// A message if the recording has no such model, or a setting applies to no model.
    pub(super) fn apply(
        models: &mut [ModelUse],
        others: &[KeyValue],
        sets: &[PluginKeyValue],
    ) -> Result<Self, String> {
        let plugins = others.iter().map(|other| exchange(other, models)).collect::<Result<Vec<_>, _>>()?;
        // Count the settings only now: a replaced model has lost those of the run.
        let recorded: Vec<usize> = models.iter().map(|model| model.plugin.parameters.len()).collect();
        sets.iter().try_for_each(|set| set.apply_to_models(models))?;
        let mut parameters = Vec::new();
        for (model, recorded) in models.iter().zip(recorded) {
            let set = model.plugin.parameters.get(recorded..).unwrap_or_default();
            parameters.extend(set.iter().map(|set| (model.name.clone(), set.key.clone())));
        }
        Ok(Self { parameters, plugins: plugins.concat() })
    }

    /// Returns true if nothing was changed.
    pub(super) fn is_nothing(&self) -> bool {
        self.parameters.is_empty() && self.plugins.is_empty()
    }

    /// Returns true if the parameter was changed and so is fixed.
    pub(super) fn keeps_parameter(&self, model: &str, parameter: &str) -> bool {
        self.parameters.iter().any(|(name, key)| name == model && key == parameter)
    }

    /// Returns true if the model's plugin was changed and so is fixed.
    pub(super) fn keeps_plugin(&self, model: &str) -> bool {
        self.plugins.iter().any(|name| name == model)
    }
}

/// Replaces a model by another plugin with its own defaults; returns the names of the models it replaces.
fn exchange(other: &KeyValue, models: &mut [ModelUse]) -> Result<Vec<String>, String> {
    let (asked, plugin) = other.pair();
    let mut exchanged = Vec::new();
    for model in models.iter_mut().filter(|model| is_named(&model.name, asked)) {
        *model = model.replaced_by(Some(plugin), &[]);
        exchanged.push(model.name.clone());
    }
    if exchanged.is_empty() {
        let names: Vec<&str> = models.iter().map(|model| model.name.as_str()).collect();
        let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        return Err(format!(
            "--model {asked}={plugin}: the recording has no model `{asked}` (it has {names})"
        ));
    }
    Ok(exchanged)
}
