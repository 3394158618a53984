//! Errors of changes to a running loop.

use flotor_live::RefusalCause;
use flotor_loader::SettingError;

/// Reason why a change was rejected.
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
        /// Requested name.
        name: String,
        /// Most similar name of a plugin of the run; `None` without a similar one.
        nearest: Option<String>,
        /// Names of all plugins of the run.
        names: Vec<String>,
    },
    /// The plugin has no such parameter, or the value is not legal for the parameter.
    #[error("[{plugin}] {error}")]
    Setting {
        /// Name of the plugin.
        plugin: String,
        /// Reason why the setting is illegal.
        #[source]
        error: SettingError,
    },
    /// The parameter is only read when the plugin is created.
    #[error("[{plugin}] `{id}` cannot change while the loop runs; {}", live_words(live))]
    Fixed {
        /// Name of the plugin.
        plugin: String,
        /// Id of the parameter.
        id: String,
        /// Ids of the parameters that can change while the loop runs.
        live: Vec<String>,
    },
    /// The name belongs to a device, which has no weight and cannot be replaced.
    #[error("`{0}` is a device, and only models have a weight and can be swapped; name a model")]
    NoWeight(String),
    /// The replacement of a model was rejected; the model stays in place.
    #[error("[{model}] model unchanged: {problem}")]
    Refused {
        /// Name of the model.
        model: String,
        /// Reason as text.
        problem: String,
        /// Class of the cause: request, plugin or other.
        cause: RefusalCause,
    },
    /// The queue of pending changes is full, or the last replacement of the model is still pending or fading.
    #[error("previous changes are pending, or a swap is still fading in; try again in a moment")]
    Busy,
    /// The loop has ended.
    #[error("the run has ended; start a new run")]
    Ended,
}

fn live_words(live: &[String]) -> String {
    match live {
        [] => "set it in the scene: no parameter of this plugin can change then".to_owned(),
        live => format!("parameters that can change then: {}", live.join(", ")),
    }
}
